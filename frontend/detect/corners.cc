#include "frontend/detect/corners.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/core/part_times.h"

namespace cohort {
namespace {

// Cells of the grid over which corners are spread; each gets an equal share. The cells are square
// in a 4:3 picture.
constexpr int kGridColumns = 8;
constexpr int kGridRows = 6;
// Minimum corner strength, as a share of the frame's strongest corner: goodFeaturesToTrack's usual
// value. The strongest is limited to kMostOfCells times the upper quartile of the cells' strongest
// corners, because a single lamp at night suppressed nearly all other corners. On ten real clips
// the ratio was 1.4 to 22, in a night video of a street 110 to 450.
constexpr double kQuality = 0.01;
constexpr double kMostOfCells = 20.0;
// Gaussian blur before detection, and the side of the corner detector's window [px]. Tuned on the
// tuning clips.
constexpr double kDenoiseSigmaPx = 1.5;
constexpr int kBlockPx = 7;

struct Candidate {
  float strength;
  int x;
  int y;
};

// The occupied positions. A bucket grid is faster than a picture of discs for few features, and as
// fast for many.
class OccupiedGrid {
 public:
  OccupiedGrid(int width, int height, double radius_px)
      : radius_(radius_px),
        columns_(static_cast<int>(width / radius_px) + 1),
        rows_(static_cast<int>(height / radius_px) + 1),
        cells_(static_cast<std::size_t>(columns_) * rows_) {}

  void Add(const Eigen::Vector2d& xy) { cells_[CellOf(xy)].push_back(xy); }

  bool IsFree(const Eigen::Vector2d& xy) const {
    const int column = ColumnOf(xy.x());
    const int row = RowOf(xy.y());
    for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r) {
      for (int c = std::max(0, column - 1); c <= std::min(columns_ - 1, column + 1); ++c) {
        for (const auto& other : cells_[static_cast<std::size_t>(r) * columns_ + c]) {
          if ((other - xy).squaredNorm() < radius_ * radius_) return false;
        }
      }
    }
    return true;
  }

 private:
  int ColumnOf(double x) const {
    return std::clamp(static_cast<int>(x / radius_), 0, columns_ - 1);
  }
  int RowOf(double y) const { return std::clamp(static_cast<int>(y / radius_), 0, rows_ - 1); }
  std::size_t CellOf(const Eigen::Vector2d& xy) const {
    return static_cast<std::size_t>(RowOf(xy.y())) * columns_ + ColumnOf(xy.x());
  }

  double radius_;
  int columns_;
  int rows_;
  std::vector<std::vector<Eigen::Vector2d>> cells_;
};

// The q-quantile of the values where the mask allows features, from every second pixel and row.
float Quantile(const cv::Mat& values, const cv::Mat& mask, int border, double q) {
  std::vector<float> sample;
  for (int y = border; y < values.rows - border; y += 2) {
    const float* row = values.ptr<float>(y);
    const std::uint8_t* allowed = mask.empty() ? nullptr : mask.ptr<std::uint8_t>(y);
    for (int x = border; x < values.cols - border; x += 2) {
      if (allowed == nullptr || allowed[x] != 0) sample.push_back(row[x]);
    }
  }
  if (sample.empty()) return 0.0F;
  const auto at = sample.begin() + static_cast<std::ptrdiff_t>(q * (sample.size() - 1));
  std::nth_element(sample.begin(), at, sample.end());
  return *at;
}

// The median corner strength of a picture's noise alone, as the lower of two estimates, because the
// scene's texture only increases either:
// - flat areas: a tenth of the pixels of most pictures; the tenth percentile of the strength of
//   noise is 0.47 of its median;
// - the finest detail, which lenses do not resolve but sensors add: the median response to the
//   difference of two Laplacians (Immerkaer 1996) is 0.67 of its deviation, which is 6 sigma. White
//   noise blurred by b px has gradients of variance sigma^2 / (8 pi b^4), and the strength of it is
//   4 times (the scale of cornerMinEigenVal) 0.39 (the smaller eigenvalue's share). Noise that was
//   blurred before we got it has less of the finest detail: hence 3 times that.
// What the mask covers does not count: black bars have no noise.
float NoiseStrength(
    const cv::Mat& gray, const cv::Mat& strength, const cv::Mat& mask, double blur_px, int border) {
  const cv::Mat kernel = (cv::Mat_<float>(3, 3) << 1, -2, 1, -2, 4, -2, 1, -2, 1);
  cv::Mat detail;
  cv::filter2D(gray, detail, CV_32F, kernel);
  cv::absdiff(detail, cv::Scalar::all(0.0), detail);
  const double sigma = Quantile(detail, mask, border, 0.5) / 0.6745 / 6.0;
  const double blur = std::max(blur_px, 0.5);
  const double fine = 3.0 * 0.39 * 4.0 * sigma * sigma / (8.0 * CV_PI * std::pow(blur, 4));
  const double flat = Quantile(strength, mask, border, 0.1) / 0.47;
  return static_cast<float>(std::min(fine, flat));
}

// The top of the parabola through three neighbouring strengths, within half a pixel.
double ParabolaPeak(float left, float middle, float right) {
  const double curvature = left - 2.0 * middle + right;
  if (curvature >= 0.0) return 0.0;
  return std::clamp(0.5 * (left - right) / curvature, -0.5, 0.5);
}

std::size_t CellOf(double x, double y, const cv::Size& size) {
  const int column =
      std::clamp(static_cast<int>(x * kGridColumns / size.width), 0, kGridColumns - 1);
  const int row = std::clamp(static_cast<int>(y * kGridRows / size.height), 0, kGridRows - 1);
  return static_cast<std::size_t>(row) * kGridColumns + column;
}

// The strength that counts as a picture's strongest, from the strongest corners of its cells. Cells
// that show only noise or a blank ground do not count.
float Strongest(std::vector<float> of_cells, float noise) {
  constexpr float kBlank = 1e-5F;  // of the strongest
  const float strongest = *std::max_element(of_cells.begin(), of_cells.end());
  std::erase_if(of_cells, [&](float s) { return s <= std::max(noise, kBlank * strongest); });
  if (of_cells.empty()) return strongest;
  const auto quartile = of_cells.begin() + static_cast<std::ptrdiff_t>(3 * of_cells.size() / 4);
  std::nth_element(of_cells.begin(), quartile, of_cells.end());
  return std::min(strongest, static_cast<float>(kMostOfCells) * *quartile);
}

// Local maxima of 3 x 3 that stand out from the picture and from its noise, the strongest first.
std::vector<Candidate> StrongestFirst(const cv::Mat& gray,
                                      const cv::Mat& strength,
                                      const cv::Mat& mask,
                                      int border,
                                      double min_over_noise) {
  std::vector<Candidate> candidates;
  std::vector<float> strongest_of(static_cast<std::size_t>(kGridColumns) * kGridRows, 0.0F);
  for (int y = border; y < strength.rows - border; ++y) {
    const float* above = strength.ptr<float>(y - 1);
    const float* row = strength.ptr<float>(y);
    const float* below = strength.ptr<float>(y + 1);
    const std::uint8_t* allowed = mask.empty() ? nullptr : mask.ptr<std::uint8_t>(y);
    for (int x = border; x < strength.cols - border; ++x) {
      if (allowed != nullptr && allowed[x] == 0) continue;
      const float s = row[x];
      float& strongest = strongest_of[CellOf(x, y, strength.size())];
      strongest = std::max(strongest, s);
      // ">=" on one side and ">" on the other, so that one of several equal neighbours remains.
      if (s > row[x - 1] && s >= row[x + 1] && s > above[x - 1] && s > above[x] &&
          s > above[x + 1] && s >= below[x - 1] && s >= below[x] && s >= below[x + 1]) {
        candidates.push_back({s, x, y});
      }
    }
  }
  const float of_noise = static_cast<float>(min_over_noise) *
                         NoiseStrength(gray, strength, mask, kDenoiseSigmaPx, border);
  const float floor = std::max(
      static_cast<float>(kQuality) * Strongest(std::move(strongest_of), of_noise), of_noise);
  std::erase_if(candidates, [&](const Candidate& c) { return c.strength <= floor; });
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    if (a.strength != b.strength) return a.strength > b.strength;
    return std::pair(a.y, a.x) < std::pair(b.y, b.x);
  });
  return candidates;
}

// The position refined to sub-pixel accuracy.
Eigen::Vector2d Refined(const Candidate& c, const cv::Mat& strength) {
  const auto at = [&](int x, int y) { return strength.at<float>(y, x); };
  return {c.x + ParabolaPeak(at(c.x - 1, c.y), c.strength, at(c.x + 1, c.y)),
          c.y + ParabolaPeak(at(c.x, c.y - 1), c.strength, at(c.x, c.y + 1))};
}

}  // namespace

std::vector<Eigen::Vector2d> DetectCorners(const cv::Mat& gray,
                                           std::span<const Eigen::Vector2d> occupied,
                                           const cv::Mat& mask,
                                           int border_px,
                                           int max_new,
                                           const DetectorOptions& options) {
  const TimedPart part("corners");
  Check(gray.type() == CV_32FC1, "DetectCorners takes CV_32FC1");
  std::vector<Eigen::Vector2d> corners;
  const int width = gray.cols;
  const int height = gray.rows;
  // OpenCV's filters do not accept a picture narrower than they are either.
  if (max_new <= 0 || std::min(width, height) <= 2 * border_px) return corners;

  cv::Mat denoised;  // a separate buffer, since `gray` is still needed for tracking
  cv::GaussianBlur(gray, denoised, cv::Size(0, 0), kDenoiseSigmaPx);
  cv::Mat strength;
  cv::cornerMinEigenVal(denoised, strength, kBlockPx, 3);

  const std::vector<Candidate> candidates =
      StrongestFirst(gray, strength, mask, std::max(border_px, 1), options.min_over_noise);

  OccupiedGrid taken(width, height, options.min_distance_px);
  constexpr int columns = kGridColumns;
  constexpr int rows = kGridRows;
  std::vector<int> in_cell(static_cast<std::size_t>(columns) * rows, 0);
  const auto cell_of = [&](double x, double y) { return CellOf(x, y, gray.size()); };
  for (const auto& xy : occupied) {
    taken.Add(xy);
    ++in_cell[cell_of(xy.x(), xy.y())];
  }
  const int share = (options.max_features + columns * rows - 1) / (columns * rows);
  const auto wanted = static_cast<std::size_t>(max_new);

  // First every cell's share, then the strongest of the remaining corners.
  for (const bool limited : {true, false}) {
    for (const Candidate& c : candidates) {
      if (corners.size() >= wanted) return corners;
      int& count = in_cell[cell_of(c.x, c.y)];
      if (limited && count >= share) continue;
      const Eigen::Vector2d xy = Refined(c, strength);
      if (!taken.IsFree(xy)) continue;  // in the second pass, also those taken in the first
      taken.Add(xy);
      corners.push_back(xy);
      ++count;
    }
  }
  return corners;
}

}  // namespace cohort
