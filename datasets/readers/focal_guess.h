#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace cohort {

// The focal length of a camera from a file's metadata, in pixels of its pictures. It is never a
// calibration: pictures may be cropped, scaled and stabilised afterwards.
struct FocalGuess {
  double focal_px = 0.0;
  double log_sigma = 1.0;  // standard deviation of its logarithm
  std::string source;      // the entry in words: "EXIF FocalLengthIn35mmFilm 26 mm"
};

struct PictureSize {
  int width_px = 0;
  int height_px = 0;
};

// From the EXIF of the first and the last picture of a clip. If they differ by more than 2 %, as
// with a zoom lens, uses the first, with a larger sigma. Returns nullopt if the first has no usable
// entry.
std::optional<FocalGuess> FocalGuessOfPictures(const std::filesystem::path& first,
                                               const std::filesystem::path& last,
                                               PictureSize size);

// From a video's metadata: `in_35mm_film` is the text of the key for the focal length of a 35 mm
// film camera with the same view, empty without one; then GoPro's field of view is used.
std::optional<FocalGuess> FocalGuessOfVideo(const std::filesystem::path& video,
                                            const std::string& in_35mm_film,
                                            PictureSize size);

}  // namespace cohort
