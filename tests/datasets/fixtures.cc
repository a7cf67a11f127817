#include "tests/datasets/fixtures.h"

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace cohort::test {

namespace fs = std::filesystem;

void WriteImage(const fs::path& file, int value, cv::Size size) {
  fs::create_directories(file.parent_path());
  if (!cv::imwrite(file.string(), cv::Mat(size, CV_8UC1, cv::Scalar(value)))) {
    throw std::runtime_error("cannot write " + file.string());
  }
}

void WriteText(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  if (!stream) throw std::runtime_error("cannot write " + file.string());
}

void CutFile(const fs::path& file, double fraction) {
  const auto size = static_cast<double>(fs::file_size(file));
  fs::resize_file(file, static_cast<std::uintmax_t>(fraction * size));
}

std::vector<Frame> ReadAll(Sequence& sequence) {
  std::vector<Frame> frames;
  while (auto frame = sequence.Next()) frames.push_back(*frame);
  return frames;
}

std::vector<std::string> Names(const std::vector<Frame>& frames) {
  std::vector<std::string> names;
  for (const Frame& frame : frames) names.push_back(frame.name);
  return names;
}

std::vector<std::uint32_t> Indices(const std::vector<Frame>& frames) {
  std::vector<std::uint32_t> indices;
  for (const Frame& frame : frames) indices.push_back(ToInt(frame.index));
  return indices;
}

}  // namespace cohort::test
