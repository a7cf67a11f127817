// What the README shows is true: its commands run, and print the table that it prints.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "frontend/core/output.h"
#include "tests/support/program.h"
#include "tests/support/source_dir.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

// A fenced block: ```sh is run, a ```text after it is what it prints.
struct Block {
  std::string kind;
  std::string text;
  std::size_t text_begin = 0;  // in the README
};

std::vector<Block> BlocksOf(const std::string& readme) {
  std::vector<Block> blocks;
  constexpr std::string_view kFence = "\n```";
  for (std::size_t at = readme.find(kFence); at != std::string::npos;
       at = readme.find(kFence, at + 1)) {
    const std::size_t begin = readme.find('\n', at + 1) + 1;
    const std::size_t end = readme.find(kFence, begin - 1) + 1;
    blocks.push_back({readme.substr(at + kFence.size(), begin - 1 - at - kFence.size()),
                      readme.substr(begin, end - begin),
                      begin});
    at = end;
  }
  return blocks;
}

// The video that the README takes as the reader's own: the rendered clip of its first commands.
void WriteClip(const fs::path& images, const fs::path& video) {
  cv::VideoWriter writer;
  for (int i = 0; i < 30; ++i) {
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

// Words equal, numbers alike: they may differ by a third from machine to machine and from one small
// change of the code to the next; beyond that the README is out of date.
void ExpectAlike(const std::string& shown, const std::string& printed) {
  std::istringstream in_shown(shown);
  std::istringstream in_printed(printed);
  std::string a;
  std::string b;
  while (in_shown >> a) {
    ASSERT_TRUE(in_printed >> b) << "the README shows more: " << a;
    const auto x = AsNumber(a);
    const auto y = AsNumber(b);
    if (x && y) {
      EXPECT_LE(std::abs(*x - *y), 0.02 + std::max(std::abs(*x), std::abs(*y)) / 3.0)
          << a << " " << b;
    } else if (a.find_first_not_of('-') != std::string::npos) {
      EXPECT_EQ(a, b);
    }
  }
  EXPECT_FALSE(in_printed >> b) << "the README shows less: " << b;
}

TEST(Readme, CommandsRunAndPrintWhatItShows) {
  const fs::path file = test::SourceDir() / "README.md";
  std::string readme = ReadBytes(file);
  const test::TempDir dir;
  const std::string prefix = fmt::format("cd {} && PATH={}:$PATH && set -e\n",
                                         dir.path().string(),
                                         fs::path(COHORT_PROGRAM).parent_path().string());
  std::string printed;
  int commands = 0;
  for (const Block& block : BlocksOf(readme)) {
    if (block.kind == "text") {
      // COHORT_UPDATE_README=1 writes the table instead of checking it.
      if (std::getenv("COHORT_UPDATE_README") != nullptr) {
        readme.replace(block.text_begin, block.text.size(), printed);
        WriteBytes(file, readme);
        return;
      }
      ExpectAlike(block.text, printed);
    }
    if (block.kind != "sh") continue;
    if (block.text.find("clip.mp4") != std::string::npos && !fs::exists(dir / "clip.mp4")) {
      WriteClip(dir / "lateral/rgb", dir / "clip.mp4");
    }
    const test::ProgramEnd end = test::RunShell(prefix + block.text);
    EXPECT_EQ(end.exit_code, 0) << block.text << end.err;
    printed = end.out;
    ++commands;
  }
  EXPECT_GE(commands, 4);
}

}  // namespace
}  // namespace cohort
