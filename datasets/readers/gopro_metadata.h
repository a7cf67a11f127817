#pragma once

#include <filesystem>
#include <optional>

namespace cohort {

// What a GoPro says of the view of its lens, in the settings that it writes into the header of an
// MP4 (moov/udta/GPMF; the format: github.com/gopro/gpmf-parser).
struct GoProView {
  double diagonal_deg = 0.0;  // ZFOV: from corner to corner of the pictures
  std::optional<char> mode;   // VFOV: W wide, S super, M medium, L linear, N narrow
};

// None where the file is of no GoPro, too old a one, or damaged.
std::optional<GoProView> ReadGoProView(const std::filesystem::path& video);

}  // namespace cohort
