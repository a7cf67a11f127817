#include "datasets/readers/focal_guess.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>

#include "datasets/readers/exif.h"
#include "datasets/readers/gopro_metadata.h"

namespace cohort {
namespace {

// The diagonal of 35 mm film, 36 x 24 mm, with which CIPA DCG-001 compares pictures of any shape.
constexpr double kFilmDiagonalMm = 43.2666;
// No camera has lenses or crops beyond these bounds; such an entry is damaged.
constexpr double kLeastMm = 1.0;
constexpr double kMostMm = 10'000.0;
constexpr double kLeastViewDeg = 1.0;
constexpr double kMostViewDeg = 179.0;

// Standard deviations of the logarithm. Cameras state whole millimetres, before the correction of
// distortion; video cameras also crop, for stabilisation or a faster readout of the sensor.
constexpr double kSigmaOfPictures = 0.1;
constexpr double kSigmaOfVideos = 0.15;
constexpr double kSigmaOfFisheyes = 0.3;
constexpr double kZoomed = 0.02;

double DiagonalOf(PictureSize size) { return std::hypot(size.width_px, size.height_px); }

bool IsOfALens(double mm) { return mm >= kLeastMm && mm <= kMostMm; }

double FocalOf35mmFilm(double mm, PictureSize size) {
  return mm / kFilmDiagonalMm * DiagonalOf(size);
}

std::optional<FocalGuess> GuessOfExif(const ExifFocal& exif, PictureSize size) {
  FocalGuess guess;
  guess.log_sigma = kSigmaOfPictures;
  if (exif.in_35mm_film_mm && IsOfALens(*exif.in_35mm_film_mm)) {
    guess.focal_px = FocalOf35mmFilm(*exif.in_35mm_film_mm, size);
    guess.source = fmt::format("EXIF FocalLengthIn35mmFilm {:g} mm", *exif.in_35mm_film_mm);
    return guess;
  }
  if (!exif.mm || !exif.pixels_per_mm) return std::nullopt;
  const double long_side_px = std::max(size.width_px, size.height_px);
  const double scale = long_side_px / exif.long_side_px.value_or(long_side_px);
  guess.focal_px = *exif.mm * *exif.pixels_per_mm * scale;
  guess.source = fmt::format("EXIF FocalLength {:g} mm with {:.4g} pixels a mm of the sensor",
                             *exif.mm,
                             *exif.pixels_per_mm * scale);
  // Compared as a lens for 35 mm film, since sensors have any size.
  if (!IsOfALens(guess.focal_px / DiagonalOf(size) * kFilmDiagonalMm)) return std::nullopt;
  return guess;
}

// The number that a text starts with.
std::optional<double> NumberIn(const std::string& text) {
  double number = 0.0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() ? std::optional(number) : std::nullopt;
}

}  // namespace

std::optional<FocalGuess> FocalGuessOfPictures(const std::filesystem::path& first,
                                               const std::filesystem::path& last,
                                               PictureSize size) {
  auto guess = GuessOfExif(ReadExifFocal(first), size);
  if (!guess || first == last) return guess;
  const auto other = GuessOfExif(ReadExifFocal(last), size);
  if (!other) return guess;
  const double change = std::log(other->focal_px / guess->focal_px);
  if (std::abs(change) > kZoomed) {
    guess->log_sigma = std::hypot(guess->log_sigma, change);
    guess->source += fmt::format(" (in the last picture {})", other->source);
  }
  return guess;
}

std::optional<FocalGuess> FocalGuessOfVideo(const std::filesystem::path& video,
                                            const std::string& in_35mm_film,
                                            PictureSize size) {
  if (const auto mm = NumberIn(in_35mm_film); mm && IsOfALens(*mm)) {
    return FocalGuess{.focal_px = FocalOf35mmFilm(*mm, size),
                      .log_sigma = kSigmaOfVideos,
                      .source = fmt::format("the video's metadata ({:g} mm of 35 mm film)", *mm)};
  }
  const auto view = ReadGoProView(video);
  if (!view || !(view->diagonal_deg >= kLeastViewDeg && view->diagonal_deg <= kMostViewDeg)) {
    return std::nullopt;
  }
  // A fisheye images a ray at f times its angle from the axis; an ordinary lens, and a view that
  // the camera linearised, at f times the tangent of the angle.
  constexpr double kWidestLinearDeg = 110.0;
  const bool wide = view->mode == 'W';
  const bool super_view = view->mode == 'S';
  const bool linear = view->mode == 'L';
  const bool fisheye = wide || super_view || (view->diagonal_deg > kWidestLinearDeg && !linear);
  const double half_rad = view->diagonal_deg / 2.0 * std::numbers::pi / 180.0;
  return FocalGuess{
      .focal_px = DiagonalOf(size) / 2.0 / (fisheye ? half_rad : std::tan(half_rad)),
      .log_sigma = fisheye ? kSigmaOfFisheyes : kSigmaOfVideos,
      .source = fmt::format("the GoPro's field of view ({:.0f} degrees from corner to corner)",
                            view->diagonal_deg)};
}

}  // namespace cohort
