// What the documents show is true: their commands run, and print the tables that stand there.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <optional>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "frontend/storage/output.h"
#include "tests/support/program.h"
#include "tests/support/source_dir.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

// A fenced block: ```sh is run, a ```text right after it is what it prints; lines of ```console
// that begin with $ are commands for developers.
struct Block {
  std::string kind;
  std::string text;
  std::size_t fence_begin = 0;  // in the document
  std::size_t text_begin = 0;
  std::size_t end = 0;  // behind the closing fence
};

std::vector<Block> BlocksOf(const std::string& document) {
  std::vector<Block> blocks;
  constexpr std::string_view kFence = "\n```";
  for (std::size_t at = document.find(kFence); at != std::string::npos;
       at = document.find(kFence, at)) {
    const std::size_t begin = document.find('\n', at + 1) + 1;
    const std::size_t close = document.find(kFence, begin - 1) + 1;
    const std::size_t kind = at + kFence.size();
    blocks.push_back({document.substr(kind, begin - 1 - kind),
                      document.substr(begin, close - begin),
                      at + 1,
                      begin,
                      close + 4});
    at = close + 3;
  }
  return blocks;
}

// All of the repository's documents, relative to its root.
std::vector<std::string> Documents() {
  std::vector<std::string> documents;
  for (const auto& folder :
       {"", "docs", "docs/results", "frontend", "backend", "datasets", "pipelines"}) {
    for (const auto& entry : fs::directory_iterator(test::SourceDir() / folder)) {
      if (entry.path().extension() != ".md") continue;
      documents.push_back(entry.path().lexically_relative(test::SourceDir()).string());
    }
  }
  std::sort(documents.begin(), documents.end());
  return documents;
}

// The video that the documents take as the reader's own: a rendered clip.
void WriteClip(const std::string& shell, const fs::path& dir) {
  const test::ProgramEnd end =
      test::RunShell(shell + "cohort synth video --motion lateral --frames 16 --quiet");
  ASSERT_EQ(end.exit_code, 0) << end.err;
  const fs::path images = dir / "video/rgb";
  const fs::path video = dir / "clip.mp4";
  cv::VideoWriter writer;
  for (int i = 0; i < 16; ++i) {
    const cv::Mat frame = cv::imread((images / fmt::format("{:06}.png", i)).string());
    ASSERT_FALSE(frame.empty());
    if (i == 0) {
      writer.open(video.string(), cv::VideoWriter::fourcc('m', 'p', '4', 'v'), 30.0, frame.size());
    }
    writer.write(frame);
  }
}

std::optional<double> AsNumber(const std::string& word) {
  char* end = nullptr;
  const double value = std::strtod(word.c_str(), &end);
  if (end != word.c_str() + word.size()) return std::nullopt;
  return value;
}

std::vector<std::string> WordsOf(const std::string& text) {
  std::istringstream in(text);
  return {std::istream_iterator<std::string>(in), std::istream_iterator<std::string>()};
}

// A unit of its last digit behind the point; none of a whole number.
double LastDigitOf(const std::string& number) {
  const std::size_t point = number.find('.');
  if (point == std::string::npos) return 0.0;
  return std::pow(10.0, static_cast<double>(point + 1) - static_cast<double>(number.size()));
}

// Words equal, numbers alike: errors of a single clip may halve or double with a small change of
// the code; beyond that the document is out of date. Those in "19 of 20" are within a tenth.
void ExpectAlike(const std::string& shown, const std::string& printed) {
  const std::vector<std::string> a = WordsOf(shown);
  const std::vector<std::string> b = WordsOf(printed);
  const auto is_of = [&a](std::size_t i) { return i < a.size() && a[i] == "of"; };
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    const auto x = AsNumber(a[i]);
    const auto y = AsNumber(b[i]);
    if (x && y) {
      const double rounding = std::max(LastDigitOf(a[i]), LastDigitOf(b[i]));
      const double share = is_of(i + 1) || (i > 0 && is_of(i - 1)) ? 0.1 : 0.5;
      EXPECT_LE(std::abs(*x - *y), rounding + share * std::max(std::abs(*x), std::abs(*y)))
          << a[i] << " " << b[i];
    } else if (a[i].find_first_not_of('-') != std::string::npos) {
      EXPECT_EQ(a[i], b[i]);
    }
  }
  EXPECT_EQ(a.size(), b.size()) << "the document shows more or less than is printed:\n" << printed;
}

// Commands for developers: those of CTest and CMake are run, of the others there is such a program.
void ExpectRuns(const std::string& line) {
  std::istringstream words(line);
  std::string program;
  words >> program;
  const std::string in_source = fmt::format("cd {} && ", test::SourceDir().string());
  if (program == "ctest" || program == "cmake") {
    const test::TempDir dir;
    // The tests that it names, by their list; what it builds, without building; the configuration
    // that it makes, in another folder.
    std::string command;
    if (program == "ctest") {
      command =
          std::regex_replace(
              line, std::regex("--test-dir \\S+"), "--test-dir " + test::BuildDir().string()) +
          " -N";
    } else if (line.starts_with("cmake --build")) {
      command = std::regex_replace(
                    line, std::regex("--build \\S+"), "--build " + test::BuildDir().string()) +
                " -- -n";
    } else {
      command = std::regex_replace(line, std::regex("&&.*"), "") + " -B " + dir.path().string();
    }
    const test::ProgramEnd end = test::RunShell(in_source + command);
    EXPECT_EQ(end.exit_code, 0) << line << "\n" << end.err;
    EXPECT_EQ(end.out.find("Total Tests: 0"), std::string::npos) << line;
    return;
  }
  if (program == "bash") words >> program;
  if (test::RunShell("command -v " + program).exit_code == 0) return;  // the machine's
  const std::string name = fs::path(program).filename().string();
  const bool known = fs::exists(test::SourceDir() / program) ||
                     fs::exists(test::SourceDir() / "tests/benchmark" / name) ||
                     fs::exists(test::SourceDir() / "tests/benchmark" / (name + ".cc"));
  EXPECT_TRUE(known) << line << ": no such program";
}

// The lines of a ```console block that begin with $, each with what a \ at its end carries on.
std::vector<std::string> CommandsOf(const std::string& block) {
  std::vector<std::string> commands;
  std::istringstream lines(std::regex_replace(block, std::regex(R"(\\\n\s*)"), ""));
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("$ ")) continue;
    line = line.substr(2, line.find(" #") - 2);
    line.erase(line.find_last_not_of(' ') + 1);
    commands.push_back(line);
  }
  return commands;
}

// The page's own folder, with what a reader has before it begins.
struct Desk {
  test::TempDir dir;
  std::string shell = fmt::format(
      "cd {} && PATH={}:$PATH && set -e\n", dir.path().string(), test::BuildDir().string());

  void Prepare(const std::string& commands) const {
    const auto names = [&commands](const char* word) {
      return commands.find(word) != std::string::npos;
    };
    if (names("clip.mp4") && !fs::exists(dir / "clip.mp4")) WriteClip(shell, dir.path());
    for (const char* folder : {"pipelines", "tests"}) {  // a reader is in the repository
      if (names(folder) && !fs::exists(dir / folder)) {
        fs::create_directory_symlink(test::SourceDir() / folder, dir / folder);
      }
    }
  }

  test::ProgramEnd Run(const std::string& commands) const {
    Prepare(commands);
    return test::RunShell(shell + commands);
  }
};

// What a page's commands need and this machine may not have.
std::string MissingProgram(const std::string& document) {
  for (const std::string& program : {std::string("snakemake")}) {
    if (document.find("\n" + program + " ") != std::string::npos &&
        test::RunShell("command -v " + program).exit_code != 0) {
      return program;
    }
  }
  return "";
}

class Document : public testing::TestWithParam<std::string> {};

TEST_P(Document, HasCommandsThatRunAndPrintWhatItShows) {
  const fs::path file = test::SourceDir() / GetParam();
  std::string document = ReadBytes(file);
  if (const std::string missing = MissingProgram(document); !missing.empty()) {
    GTEST_SKIP() << "no " << missing;
  }
  const Desk desk;
  std::string printed;
  std::size_t end_of_command = std::string::npos;
  for (const Block& block : BlocksOf(document)) {
    if (block.kind == "text" && block.fence_begin == end_of_command) {
      // COHORT_UPDATE_DOCUMENTS=1 writes the table instead of checking it.
      if (std::getenv("COHORT_UPDATE_DOCUMENTS") != nullptr) {
        document.replace(block.text_begin, block.text.size(), printed);
        WriteBytes(file, document);
        return;
      }
      ExpectAlike(block.text, printed);
    }
    if (block.kind == "console") {
      for (const std::string& command : CommandsOf(block.text)) {
        if (command.starts_with("cohort ") || command.starts_with("snakemake ")) {
          // What a cluster would do is only planned.
          const test::ProgramEnd end =
              desk.Run(command + (command.starts_with("snakemake ") ? " --dry-run" : ""));
          EXPECT_EQ(end.exit_code, 0) << command << "\n" << end.err;
        } else {
          ExpectRuns(command);
        }
      }
    }
    if (block.kind != "sh") continue;
    const test::ProgramEnd end = desk.Run(block.text);
    EXPECT_EQ(end.exit_code, 0) << block.text << end.err;
    printed = end.out;
    end_of_command = block.end;
  }
}

// README.md -> README_md
std::string NameOfDocument(const testing::TestParamInfo<std::string>& info) {
  return std::regex_replace(info.param, std::regex("[^A-Za-z]"), "_");
}

INSTANTIATE_TEST_SUITE_P(Of, Document, testing::ValuesIn(Documents()), NameOfDocument);

}  // namespace
}  // namespace cohort
