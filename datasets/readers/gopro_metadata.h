#pragma once

#include <filesystem>
#include <optional>

namespace cohort {

// The view of a GoPro's lens, from the settings in the header of its MP4 (moov/udta/GPMF; the
// format: github.com/gopro/gpmf-parser).
struct GoProView {
  double diagonal_deg = 0.0;  // ZFOV: from corner to corner of the pictures
  std::optional<char> mode;   // VFOV: W wide, S super, M medium, L linear, N narrow
};

// Returns nullopt if the file is not from a GoPro, from too old a one, or damaged.
std::optional<GoProView> ReadGoProView(const std::filesystem::path& video);

}  // namespace cohort
