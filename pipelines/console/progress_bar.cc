#include "pipelines/console/progress_bar.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string_view>

#include "pipelines/console/messages.h"

namespace cohort {

namespace {

// The width of stderr's terminal; a usual one if it is not available.
std::size_t TerminalWidth() {
  constexpr std::size_t kUsual = 80;
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kUsual;
  return size.ws_col;
}

// Whether stderr is a terminal that can overwrite a line.
bool IsTerminal() {
  const char* const kind = std::getenv("TERM");
  return isatty(STDERR_FILENO) == 1 && (kind == nullptr || std::string_view(kind) != "dumb");
}

}  // namespace

std::string ProgressLine(const std::string& label,
                         std::size_t done,
                         std::optional<std::size_t> total,
                         double seconds,
                         const std::string& rate_unit) {
  const double rate = seconds > 0.0 ? static_cast<double>(done) / seconds : 0.0;
  const std::string speed = rate_unit.empty() ? "" : fmt::format("  {:.1f} {}", rate, rate_unit);
  if (!total || *total == 0) return fmt::format("{} {}{}", label, done, speed);
  constexpr std::size_t kWidth = 30;
  const std::size_t shown = std::min(done, *total);
  std::string line = fmt::format("{} [{:<{}}] {}/{}{}",
                                 label,
                                 std::string(kWidth * shown / *total, '='),
                                 kWidth,
                                 done,
                                 *total,
                                 speed);
  if (rate > 0.0) {
    const auto left = std::lround(static_cast<double>(*total - shown) / rate);
    line += fmt::format("  ETA {}:{:02}", left / 60, left % 60);
  }
  return line;
}

ProgressBar::ProgressBar(std::string label, std::optional<std::size_t> total, std::string rate_unit)
    : shown_(IsTerminal() && spdlog::should_log(spdlog::level::info)),
      label_(std::move(label)),
      total_(total),
      rate_unit_(std::move(rate_unit)) {}

ProgressBar::~ProgressBar() { Wipe(); }

void ProgressBar::Wipe() {
  if (shown_) std::fputs("\r\x1b[K", OwnStderr());
}

void ProgressBar::Advance(std::size_t steps) {
  done_ += steps;
  const auto now = Clock::now();
  if (!shown_ || now < next_draw_) return;
  next_draw_ = now + std::chrono::milliseconds(100);
  const double seconds = std::chrono::duration<double>(now - start_).count();
  const std::string line = ProgressLine(label_, done_, total_, seconds, rate_unit_);
  std::FILE* const out = OwnStderr();
  // A wrapped line could not be overwritten.
  const std::string drawn =
      fmt::format("\r{}\x1b[K", std::string_view(line).substr(0, TerminalWidth() - 1));
  std::fputs(drawn.c_str(), out);  // fmt::print would throw if the disk is full
  std::fflush(out);
}

JobReport ConsoleReport() {
  struct Current {
    std::string stage;
    std::size_t done = 0;
    std::optional<ProgressBar> bar;
  };
  const auto current = std::make_shared<Current>();
  const auto line_of = [current](spdlog::level::level_enum level) {
    return [current, level](const std::string& line) {
      current->bar.reset();  // which the line would follow
      spdlog::log(level, "{}", line);
    };
  };
  const auto progress =
      [current](std::string_view stage, std::size_t done, std::optional<std::size_t> total) {
        if (!current->bar || current->stage != stage) {
          current->stage = stage;
          current->done = 0;
          current->bar.emplace(current->stage, total);
        }
        current->bar->Advance(done - current->done);
        current->done = done;
      };
  return {progress, line_of(spdlog::level::info), line_of(spdlog::level::warn)};
}

StageProgress ProgressBars() { return ConsoleReport().progress; }

}  // namespace cohort
