#include "pipelines/console/progress_bar.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace cohort {

std::string ProgressLine(const std::string& label,
                         std::size_t done,
                         std::optional<std::size_t> total,
                         double seconds) {
  const double fps = seconds > 0.0 ? static_cast<double>(done) / seconds : 0.0;
  if (!total || *total == 0) return fmt::format("{} {}  {:.1f} fps", label, done, fps);
  constexpr std::size_t kWidth = 30;
  const std::size_t filled = kWidth * std::min(done, *total) / *total;
  const std::size_t left = *total - std::min(done, *total);
  const auto eta = fps > 0.0 ? static_cast<long>(static_cast<double>(left) / fps + 0.5) : 0L;
  return fmt::format("{} [{:<{}}] {}/{}  {:.1f} fps  ETA {}:{:02}",
                     label,
                     std::string(filled, '='),
                     kWidth,
                     done,
                     *total,
                     fps,
                     eta / 60,
                     eta % 60);
}

ProgressBar::ProgressBar(std::string label, std::optional<std::size_t> total)
    : shown_(isatty(STDERR_FILENO) == 1 && spdlog::should_log(spdlog::level::info)),
      label_(std::move(label)),
      total_(total) {}

ProgressBar::~ProgressBar() {
  if (shown_) std::fputs("\r\x1b[K", stderr);
}

void ProgressBar::Advance() {
  ++done_;
  const auto now = Clock::now();
  if (!shown_ || now < next_draw_) return;
  next_draw_ = now + std::chrono::milliseconds(100);
  const double seconds = std::chrono::duration<double>(now - start_).count();
  fmt::print(stderr, "\r{}\x1b[K", ProgressLine(label_, done_, total_, seconds));
  std::fflush(stderr);
}

}  // namespace cohort
