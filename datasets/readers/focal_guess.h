#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace cohort {

// What a file says of the focal length of its camera, in pixels of its pictures. It is never a
// calibration: pictures are cropped, scaled and stabilised after the lens was named.
struct FocalGuess {
  double focal_px = 0.0;
  double log_sigma = 1.0;  // standard deviation of its logarithm
  std::string source;      // what says so, in words: "EXIF FocalLengthIn35mmFilm 26 mm"
};

struct PictureSize {
  int width_px = 0;
  int height_px = 0;
};

// By EXIF of the first and the last picture of a clip. Where they differ by more than 2 %, as of a
// lens that zooms, that of the first, less sure. None where the first says nothing that can be
// used.
std::optional<FocalGuess> FocalGuessOfPictures(const std::filesystem::path& first,
                                               const std::filesystem::path& last,
                                               PictureSize size);

// By what a video says: `in_35mm_film` is the text of a key that names the focal length of a camera
// of 35 mm film with the same view, empty without one; else by GoPro's field of view.
std::optional<FocalGuess> FocalGuessOfVideo(const std::filesystem::path& video,
                                            const std::string& in_35mm_film,
                                            PictureSize size);

}  // namespace cohort
