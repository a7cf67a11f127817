#include "frontend/track/loop/scene_watch.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "frontend/core/part_times.h"

namespace cohort {
namespace {

// Between thirteen real clips joined end to end, in daylight, the match was at most 0.33, and the
// flow exceeded 0.22 at 3 of 612 cuts; frames of one scene that moved too fast for a match of 0.5
// had a flow of 0.25 and more, also in the dark. If a scene fades into noise, its match falls by
// less than half. The results are in docs/results/cuts.md.
constexpr double kSame = 0.5;   // match
constexpr double kDrop = 0.5;   // of match, from frame to frame
constexpr double kFlow = 0.22;  // share of blocks

constexpr double kSmallArea = 4800.0;  // pixels
constexpr double kCoarsePx = 6.0;      // of the small picture: coarser shades are removed
constexpr int kWatchedBlockPx = 10;
constexpr int kLeastBlocks = 20;  // with fewer, no share is meaningful

// Empty if the picture is too small.
cv::Mat SmallPicture(const Pyramid& picture) {
  const double scale = std::min(1.0, std::sqrt(kSmallArea / picture.levels[0].size().area()));
  const cv::Size size(static_cast<int>(std::lround(scale * picture.width())),
                      static_cast<int>(std::lround(scale * picture.height())));
  if ((size.width / kWatchedBlockPx) * (size.height / kWatchedBlockPx) < kLeastBlocks) return {};
  const auto level =
      std::find_if(picture.levels.rbegin(), picture.levels.rend(), [&](const cv::Mat& candidate) {
        return candidate.cols >= size.width && candidate.rows >= size.height;
      });
  cv::Mat small;
  cv::resize(*level, small, size, 0.0, 0.0, cv::INTER_AREA);
  cv::Mat coarse;
  cv::GaussianBlur(small, coarse, cv::Size(0, 0), kCoarsePx);
  return small - coarse;
}

double Correlation(const cv::Mat& a, const cv::Mat& b) {
  const double squares = a.dot(a) * b.dot(b);
  return squares > 0.0 ? a.dot(b) / std::sqrt(squares) : 0.0;
}

// The correlation of the overlap of two pictures, without a shift or with that of phase
// correlation, whichever is larger.
double Match(const cv::Mat& before, const cv::Mat& now) {
  const double unshifted = Correlation(before, now);
  const cv::Point2d peak = cv::phaseCorrelate(before, now);
  if (!(std::isfinite(peak.x) && std::isfinite(peak.y))) return unshifted;
  const cv::Point shift(static_cast<int>(std::lround(peak.x)),
                        static_cast<int>(std::lround(peak.y)));
  const cv::Rect picture(cv::Point(0, 0), before.size());
  const cv::Rect overlap = picture & (picture - shift);
  if (overlap.width < picture.width / 2 || overlap.height < picture.height / 2) return unshifted;
  return std::max(unshifted, Correlation(before(overlap), now(overlap + shift)));
}

// The share of blocks that move like a neighbour, to within 2 px.
double Flow(const cv::Mat& before, const cv::Mat& now) {
  constexpr int kAlikePx = 2;
  const int columns = before.cols / kWatchedBlockPx;
  const int rows = before.rows / kWatchedBlockPx;
  const cv::Point corner((before.cols - columns * kWatchedBlockPx) / 2,
                         (before.rows - rows * kWatchedBlockPx) / 2);
  std::vector<cv::Point> shifts;
  cv::Mat likeness;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const cv::Point at = corner + kWatchedBlockPx * cv::Point(column, row);
      const cv::Rect block(at, cv::Size(kWatchedBlockPx, kWatchedBlockPx));
      cv::matchTemplate(now, before(block), likeness, cv::TM_CCOEFF_NORMED);
      cv::Point best;
      cv::minMaxLoc(likeness, nullptr, nullptr, nullptr, &best);
      shifts.push_back(best - at);
    }
  }
  int alike = 0;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const auto goes_like = [&](int other_column, int other_row) {
        if (other_column < 0 || other_row < 0 || other_column >= columns || other_row >= rows) {
          return false;
        }
        const cv::Point difference =
            shifts[row * columns + column] - shifts[other_row * columns + other_column];
        return std::abs(difference.x) <= kAlikePx && std::abs(difference.y) <= kAlikePx;
      };
      if (goes_like(column - 1, row) || goes_like(column + 1, row) || goes_like(column, row - 1) ||
          goes_like(column, row + 1)) {
        ++alike;
      }
    }
  }
  return static_cast<double>(alike) / (columns * rows);
}

// Whether `small` shows nothing compared with `last`, with which it has nothing in common. `blank`:
// the blank picture before it, or empty. A dim scene has little contrast too, but matches itself in
// the next frame. `step`: of the picture's intensities; a contrast below half a step shows nothing.
bool IsBlank(const cv::Mat& small, const cv::Mat& last, const cv::Mat& blank, double step) {
  constexpr double kLess = 0.1;
  const auto contrast = [](const cv::Mat& picture) {
    return cv::norm(picture) / std::sqrt(static_cast<double>(picture.total()));
  };
  if (contrast(small) < 0.5 * step) return true;
  if (contrast(small) > kLess * contrast(last)) return false;
  return blank.empty() || Match(blank, small) < kSame;
}

}  // namespace

SceneChange SceneWatch::Follow(const Pyramid& picture) {
  const TimedPart part("scene watch");
  cv::Mat small = SmallPicture(picture);
  if (small.empty()) return SceneChange::kNone;
  SceneChange change = SceneChange::kNone;
  double match = 0.0;
  if (!last_.empty()) {
    match = Match(last_, small);
    if (match_ >= kSame && match < kDrop * match_ && Flow(last_, small) < kFlow) {
      if (IsBlank(small, last_, blank_, picture.step)) {
        blank_ = std::move(small);
        return SceneChange::kBlank;
      }
      change = SceneChange::kCut;
      match = 0.0;  // nothing is known yet about the new scene
    }
  }
  last_ = std::move(small);
  match_ = match;
  blank_.release();
  return change;
}

}  // namespace cohort
