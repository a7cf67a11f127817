// Folders in the layouts of TUM, EuRoC and KITTI: lists, calibrations, true poses.
#include "datasets/open_sequence.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

namespace {

// A picture of 2 x 1 pixels, that all lists may name.
constexpr std::string_view kPicture("P5 2 1 255\n\x10\x20", 13);

void Open(const std::filesystem::path& folder) {
  Try([&] {
    const auto sequence = OpenSequence(folder);
    for (int i = 0; i < 3 && sequence->Next(); ++i) {
    }
    sequence->KnownCamera();
    if (sequence->TrueCamFromWorld().contains(FrameIndex{0})) sequence->TrueDepth(FrameIndex{0});
  });
}

void Write(const std::filesystem::path& file, std::string_view bytes) {
  std::filesystem::create_directories(file.parent_path());
  WriteBytes(file, bytes);
}

}  // namespace

void Run(std::string_view bytes) {
  if (bytes.empty()) return;
  const int layout = static_cast<unsigned char>(bytes[0]) % 3;
  const auto parts = Split(bytes.substr(1), 3);
  const std::filesystem::path folder = Folder() / fmt::format("{}", layout);
  if (layout == 0) {
    Write(folder / "rgb/0.pgm", kPicture);
    Write(folder / "rgb.txt", parts[0]);
    Write(folder / "calibration.txt", parts[1]);
    Write(folder / "groundtruth.txt", parts[2]);
  } else if (layout == 1) {
    Write(folder / "mav0/cam0/data/0.pgm", kPicture);
    Write(folder / "mav0/cam0/data.csv", parts[0]);
    Write(folder / "mav0/cam0/sensor.yaml", parts[1]);
    Write(folder / "mav0/state_groundtruth_estimate0/data.csv", parts[2]);
  } else {
    Write(folder / "image_0/000000.pgm", kPicture);
    Write(folder / "calib.txt", parts[0]);
    Write(folder / "poses.txt", parts[1]);
    Write(folder / "times.txt", parts[2]);
  }
  Open(folder);
}

}  // namespace cohort::fuzz
