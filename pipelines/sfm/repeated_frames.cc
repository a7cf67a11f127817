#include "pipelines/sfm/repeated_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "frontend/core/statistics.h"

namespace cohort {
namespace {

// The constants were tuned on five real clips stored at 30 instead of 24 frames a second, and as
// they are, by H.264 (CRF 23 to 45, with and without B-frames), MPEG-4 and MJPEG. Copies had up to
// .01 of their neighbours' change in MJPEG, .15 in MPEG-4, and .4 at CRF 23. Frames of moving clips
// had .17 of it and more, nearly all .3 and more.
constexpr double kSurelyCopied = 0.15;
// Below it a copy is sure even where the camera changes its speed beside it.
constexpr double kHardlyDiffers = 0.05;
constexpr double kMayBeCopied = 0.5;
// What remains of a copy in a regular order of copies that is established.
constexpr double kCopiedInOrder = 0.8;
// The least change of a pair of frames that shows anything, in intensities of 255: codecs renew
// still pictures by less.
constexpr double kLeastChange = 1.0;

using Flags = std::vector<char>;

double MostWithin(const std::vector<FrameChange>& changes, std::size_t begin, std::size_t end) {
  double most = 0.0;
  for (std::size_t i = begin; i < end; ++i) most = std::max(most, changes[i].rms);
  return begin < end ? most : std::numeric_limits<double>::infinity();
}

struct Evidence {
  double ratio = std::numeric_limits<double>::infinity();  // to the change around it
  bool reliable = false;  // the change around it is motion, or noise of one strength
  bool abrupt = false;    // beside it, or the copies next to it, there is at least half as much
};

// The change nearest to i in one direction that is no copy's.
double NextTo(const std::vector<FrameChange>& changes, std::size_t i, int step, double around) {
  constexpr double kCopy = 0.3;
  const auto n = static_cast<std::ptrdiff_t>(changes.size());
  for (auto j = static_cast<std::ptrdiff_t>(i) + step; j >= 0 && j < n; j += step) {
    const double rms = changes[static_cast<std::size_t>(j)].rms;
    if (rms >= kCopy * around) return rms;
  }
  return std::numeric_limits<double>::infinity();
}

Evidence EvidenceAt(const std::vector<FrameChange>& changes, std::size_t i) {
  constexpr std::size_t kReach = 4;   // 24 pictures a second at 60 have two copies in a row
  constexpr std::size_t kWindow = 8;  // on each side
  constexpr double kMotion = 0.45;    // FrameChange::moved
  constexpr double kSpread = 1.6;     // of the changes by noise alone
  constexpr std::size_t kMostBetween = 2;
  const std::size_t n = changes.size();
  const double around = std::min(MostWithin(changes, i - std::min(i, kReach), i),
                                 MostWithin(changes, i + 1, std::min(n, i + 1 + kReach)));
  if (!std::isfinite(around) || around < kLeastChange) return {};
  Evidence evidence{changes[i].rms / around};
  // A camera that sways slows down before it turns.
  constexpr double kAbrupt = 0.5;
  evidence.abrupt =
      std::min(NextTo(changes, i, -1, around), NextTo(changes, i, 1, around)) >= kAbrupt * around;
  std::vector<double> all;
  for (std::size_t j = i - std::min(i, kWindow); j < std::min(n, i + 1 + kWindow); ++j) {
    all.push_back(changes[j].rms);
  }
  const double usual = Quantile(all, 0.75);
  std::vector<double> moved;
  std::vector<double> large;
  std::size_t between = 0;
  for (std::size_t j = i - std::min(i, kWindow); j < std::min(n, i + 1 + kWindow); ++j) {
    const double rms = changes[j].rms;
    if (rms >= 0.2 * usual) moved.push_back(changes[j].moved);
    if (rms >= 0.6 * usual) large.push_back(rms);
    if (rms >= 0.2 * usual && rms < 0.6 * usual) ++between;
  }
  evidence.reliable =
      Median(std::move(moved)) >= kMotion ||
      (between <= kMostBetween && Quantile(large, 0.9) <= kSpread * Quantile(large, 0.1));
  return evidence;
}

// Whether most frames near it that are no copies differ visibly: otherwise the clip stands still.
bool IsAmongChanges(const std::vector<FrameChange>& changes, const Flags& copied, std::size_t i) {
  constexpr std::size_t kReach = 24;
  constexpr double kMost = 0.75;
  std::size_t all = 0;
  std::size_t visible = 0;
  for (std::size_t j = i - std::min(i, kReach); j < std::min(changes.size(), i + 1 + kReach); ++j) {
    if (copied[j] != 0) continue;
    ++all;
    if (changes[j].rms >= kLeastChange) ++visible;
  }
  return static_cast<double>(visible) >= kMost * static_cast<double>(all);
}

// `pictures` of every `shown` frames are new ones, as even as possible.
struct Order {
  std::size_t pictures;
  std::size_t shown;
  std::size_t phase = 0;

  bool IsCopy(std::size_t i) const {  // frame i + 1 of i
    return ((i + 1) * pictures + phase) / shown == (i * pictures + phase) / shown;
  }
};

// 15 in 30, 20 in 30, 24 in 60, 18 in 30, 24 in 30, 25 in 30 ... The order must hold throughout.
constexpr std::array<Order, 7> kOrders{{{1, 2}, {2, 3}, {2, 5}, {3, 5}, {3, 4}, {4, 5}, {5, 6}}};

// How well an order explains which frames may be copies.
struct Fit {
  double hits = 0.0;    // share of its copies that may be some
  double others = 0.0;  // share of its pictures that may be copies
  double sure = 0.0;    // share of its copies that surely are
  bool Holds() const {
    constexpr double kHits = 0.8;
    // If many copies are sure, slow moments between them may look like copies.
    constexpr double kManySure = 0.3;
    return hits >= kHits && others <= (sure >= kManySure ? 0.1 : 0.03);
  }
  double Score() const { return hits - 3.0 * others + (Holds() ? 10.0 : 0.0); }
};

Fit FitOf(const Order& order, const Flags& may, const Flags& sure) {
  constexpr std::size_t kLeastCopies = 8;  // fewer may agree by chance
  std::size_t copies = 0;
  std::size_t hits = 0;
  std::size_t others = 0;
  std::size_t surely = 0;
  for (std::size_t i = 0; i < may.size(); ++i) {
    const bool copy = order.IsCopy(i);
    copies += copy ? 1 : 0;
    hits += copy && may[i] != 0 ? 1 : 0;
    others += !copy && may[i] != 0 ? 1 : 0;
    surely += copy && sure[i] != 0 ? 1 : 0;
  }
  if (copies < kLeastCopies) return {};
  const auto share = [](std::size_t part, std::size_t whole) {
    return static_cast<double>(part) / static_cast<double>(std::max<std::size_t>(1, whole));
  };
  return {share(hits, copies), share(others, may.size() - copies), share(surely, copies)};
}

}  // namespace

FrameChange ChangeBetween(const cv::Mat& gray, const cv::Mat& next_gray) {
  constexpr int kSmaller = 4;
  constexpr int kBlock = 8;
  if (gray.size() != next_gray.size() || gray.type() != next_gray.type()) return {255.0, 0.0};
  const double unit = gray.depth() == CV_16U ? 1.0 / 257.0 : 1.0;
  FrameChange change;
  change.rms =
      unit * cv::norm(gray, next_gray, cv::NORM_L2) / std::sqrt(static_cast<double>(gray.total()));
  const cv::Size blocks(gray.cols / (kSmaller * kBlock), gray.rows / (kSmaller * kBlock));
  if (change.rms == 0.0 || blocks.empty()) return change;
  const cv::Rect used(0, 0, kSmaller * kBlock * blocks.width, kSmaller * kBlock * blocks.height);
  const auto smaller = [&](const cv::Mat& picture) {
    cv::Mat small;
    picture(used).convertTo(small, CV_32F, unit);
    cv::resize(small, small, blocks * kBlock, 0.0, 0.0, cv::INTER_AREA);
    return small;
  };
  const cv::Mat a = smaller(gray);
  const cv::Mat b = smaller(next_gray);
  const cv::Mat difference = b - a;
  const cv::Mat middle = 0.5 * (a + b);
  cv::Mat dx;
  cv::Mat dy;
  const cv::Mat central = (cv::Mat_<float>(1, 3) << -0.5F, 0.0F, 0.5F);
  cv::filter2D(middle, dx, CV_32F, central, {-1, -1}, 0.0, cv::BORDER_REPLICATE);
  cv::filter2D(middle, dy, CV_32F, central.t(), {-1, -1}, 0.0, cv::BORDER_REPLICATE);
  const auto sums = [&](const cv::Mat& u, const cv::Mat& v) {  // means over blocks of u v
    cv::Mat product = u.mul(v);
    cv::resize(product, product, blocks, 0.0, 0.0, cv::INTER_AREA);
    return product;
  };
  const cv::Mat xx = sums(dx, dx);
  const cv::Mat xy = sums(dx, dy);
  const cv::Mat yy = sums(dy, dy);
  const cv::Mat xd = sums(dx, difference);
  const cv::Mat yd = sums(dy, difference);
  const cv::Mat dd = sums(difference, difference);
  constexpr double kFlat = 0.25;  // regularizes blocks without texture [intensities^2]
  double explained = 0.0;
  double all = 0.0;
  for (int y = 0; y < blocks.height; ++y) {
    for (int x = 0; x < blocks.width; ++x) {
      const double m00 = xx.at<float>(y, x) + kFlat;
      const double m11 = yy.at<float>(y, x) + kFlat;
      const double m01 = xy.at<float>(y, x);
      const double r0 = xd.at<float>(y, x);
      const double r1 = yd.at<float>(y, x);
      explained += (m11 * r0 * r0 - 2.0 * m01 * r0 * r1 + m00 * r1 * r1) / (m00 * m11 - m01 * m01);
      all += dd.at<float>(y, x);
    }
  }
  change.moved = all > 0.0 ? explained / all : 0.0;
  return change;
}

std::vector<std::size_t> FindRepeats(const std::vector<FrameChange>& changes) {
  const std::size_t n = changes.size();
  std::vector<Evidence> evidence;
  for (std::size_t i = 0; i < n; ++i) evidence.push_back(EvidenceAt(changes, i));
  const auto below = [&](double bound) {
    Flags flags(n, 0);
    for (std::size_t i = 0; i < n; ++i) {
      flags[i] = evidence[i].reliable && evidence[i].ratio < bound ? 1 : 0;
    }
    return flags;
  };
  Flags sure = below(kSurelyCopied);
  for (std::size_t i = 0; i < n; ++i) {
    if (!evidence[i].abrupt && evidence[i].ratio >= kHardlyDiffers) sure[i] = 0;
  }
  const Flags may = below(kMayBeCopied);
  Flags copied = sure;
  Fit best;
  Order best_order{};
  for (Order order : kOrders) {
    for (order.phase = 0; order.phase < order.shown; ++order.phase) {
      const Fit fit = FitOf(order, may, sure);
      if (fit.Score() <= best.Score()) continue;
      best = fit;
      best_order = order;
    }
  }
  if (best.Holds()) {
    const Flags in_order = below(kCopiedInOrder);
    for (std::size_t i = 0; i < n; ++i) {
      if (best_order.IsCopy(i) && in_order[i] != 0) copied[i] = 1;
    }
  }
  std::vector<std::size_t> repeats;
  for (std::size_t i = 0; i < n; ++i) {
    if (copied[i] != 0 && IsAmongChanges(changes, copied, i)) repeats.push_back(i + 1);
  }
  return repeats;
}

std::string DescribeRepeats(const TrackFile& file) {
  if (file.repeats.empty()) return "";
  return fmt::format("{} of {} frames repeat the one before; each picture is used once",
                     file.repeats.size(),
                     file.frames.size() + file.repeats.size());
}

}  // namespace cohort
