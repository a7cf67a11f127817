#include "backend/judge/aside.h"

#include <algorithm>
#include <optional>

#include "frontend/core/statistics.h"

namespace cohort {
namespace {

// Frames with fewer tracks show nothing: black ones had none, and plain walls some.
constexpr std::size_t kNoTracks = 3;
// Fewer do not tell whether a picture stands still.
constexpr std::size_t kEnoughTracks = 10;

// Frames begin to end - 1 of the file's list.
struct Range {
  std::size_t begin;
  std::size_t end;
};

std::vector<Range> PiecesBetweenCuts(const TrackFile& file) {
  std::vector<Range> pieces;
  std::size_t begin = 0;
  for (const FrameIndex cut : file.meta.cuts) {
    const auto at = std::ranges::lower_bound(file.frames, cut, {}, &FrameInfo::index);
    const auto end = static_cast<std::size_t>(at - file.frames.begin());
    if (end > begin) pieces.push_back({begin, end});
    begin = end;
  }
  if (begin < file.frames.size()) pieces.push_back({begin, file.frames.size()});
  return pieces;
}

class AsideFinder {
 public:
  AsideFinder(const TrackFile& file, const Reconstruction& model) : file_(file), model_(model) {}

  std::vector<Aside> Find() {
    for (const Range& piece : PiecesBetweenCuts(file_)) {
      std::size_t first = piece.begin;
      while (first < piece.end && !HasPose(first)) ++first;
      if (first == piece.end) {
        AddPiece(piece);
        continue;
      }
      std::size_t end = piece.end;
      while (!HasPose(end - 1)) --end;
      AddEdge({piece.begin, first}, true);
      AddEdge({end, piece.end}, false);
    }
    return std::move(asides_);
  }

 private:
  bool HasPose(std::size_t i) const {
    return model_.cam_from_world.contains(file_.frames[i].index);
  }

  std::size_t Observed(std::size_t i) const {
    return file_.tracks.CountObserved(file_.frames[i].index);
  }
  bool ShowsNothing(std::size_t i) const { return Observed(i) < kNoTracks; }

  bool SharesPoints(std::size_t i) const {
    constexpr double kShare = 0.1;
    std::size_t with_point = 0;
    for (const Observation* o : file_.tracks.InFrame(file_.frames[i].index)) {
      if (IsObserved(*o) && model_.points.contains(o->feature)) ++with_point;
    }
    return static_cast<double>(with_point) > kShare * static_cast<double>(Observed(i));
  }

  // Whether the tracks of frame i lie where they lie in the other frame.
  bool StandsStill(std::size_t i, std::size_t other) const {
    constexpr double kStillPx = 0.5;
    std::vector<double> motions =
        file_.tracks.MotionsPx(file_.frames[i].index, file_.frames[other].index);
    return motions.size() >= kEnoughTracks && Median(std::move(motions)) <= kStillPx;
  }

  // The longest stretch of the range in which every frame stands still with the stretch's first.
  std::optional<Range> StillIn(const Range& range) const {
    constexpr std::size_t kLeastFrames = 5;
    Range longest{range.begin, range.begin};
    for (std::size_t begin = range.begin; begin < range.end;) {
      std::size_t end = begin + 1;
      while (end < range.end && StandsStill(begin, end)) ++end;
      if (end - begin > longest.end - longest.begin) longest = {begin, end};
      begin = end;
    }
    if (longest.end - longest.begin < kLeastFrames) return std::nullopt;
    return longest;
  }

  void Add(const Range& range, AsideKind kind) {
    if (range.begin >= range.end) return;
    const FrameIndex first = file_.frames[range.begin].index;
    const FrameIndex last = file_.frames[range.end - 1].index;
    if (!asides_.empty() && asides_.back().kind == kind && joins_ == range.begin) {
      asides_.back().last = last;
    } else {
      asides_.push_back({first, last, kind});
    }
    joins_ = range.end;
  }

  // A piece of the clip that the model does not show at all.
  void AddPiece(const Range& piece) {
    std::size_t blank = 0;
    for (std::size_t i = piece.begin; i < piece.end; ++i) blank += ShowsNothing(i) ? 1 : 0;
    const std::size_t frames = piece.end - piece.begin;
    if (2 * blank > frames) return Add(piece, AsideKind::kBlank);
    const std::optional<Range> still = StillIn(piece);
    const bool mostly = still && 2 * (still->end - still->begin) > frames;
    Add(piece, mostly ? AsideKind::kCard : AsideKind::kOtherScene);
  }

  // Frames without a pose at the beginning or the end of a piece that the model shows.
  void AddEdge(const Range& edge, bool at_beginning) {
    constexpr std::size_t kLongestFade = 45;
    if (edge.begin == edge.end) return;
    // Frames of the edge, counted from the outside.
    const auto from_outside = [&](std::size_t begin, std::size_t end) {
      return at_beginning ? Range{edge.begin + begin, edge.begin + end}
                          : Range{edge.end - end, edge.end - begin};
    };
    const auto frame_from_outside = [&](std::size_t n) { return from_outside(n, n + 1).begin; };
    const std::size_t all = edge.end - edge.begin;
    std::size_t blank = 0;
    while (blank < all && ShowsNothing(frame_from_outside(blank))) ++blank;
    std::size_t outside = blank;  // how many frames, from outside, are aside
    AsideKind kind = AsideKind::kBlank;
    if (const auto still = StillIn(from_outside(blank, all));
        still && !SharesPoints(still->begin)) {
      kind = AsideKind::kCard;
      outside = at_beginning ? still->end - edge.begin : edge.end - still->begin;
    }
    if (outside == 0) return;
    const std::size_t left = all - outside;
    if (left <= kLongestFade &&
        !SharesPoints(frame_from_outside(outside + left / 2 - (left > 0 ? 0 : 1)))) {
      outside = all;
    }
    // In the clip's order. Add joins the two where they are of one kind.
    if (at_beginning) Add(from_outside(0, blank), AsideKind::kBlank);
    Add(from_outside(blank, outside), kind);
    if (!at_beginning) Add(from_outside(0, blank), AsideKind::kBlank);
  }

  const TrackFile& file_;
  const Reconstruction& model_;
  std::vector<Aside> asides_;
  std::size_t joins_ = 0;  // where the last aside ends
};

}  // namespace

std::vector<Aside> FindAsides(const TrackFile& file, const Reconstruction& model) {
  if (model.cam_from_world.empty()) return {};
  return AsideFinder(file, model).Find();
}

std::size_t CountFrames(const std::vector<Aside>& asides, const TrackFile& file) {
  const auto frames = std::ranges::count_if(
      file.frames, [&](const FrameInfo& frame) { return AnyHas(asides, frame.index); });
  const auto repeats = std::ranges::count_if(
      file.repeats, [&](const RepeatedFrame& repeat) { return AnyHas(asides, repeat.original); });
  return static_cast<std::size_t>(frames + repeats);
}

ReconstructionSummary SummarizeModelOf(const TrackFile& file, const Reconstruction& model) {
  std::vector<Aside> asides = FindAsides(file, model);
  ReconstructionSummary summary = Summarize(model, file.FrameCount(), CountFrames(asides, file));
  summary.asides = std::move(asides);
  return summary;
}

}  // namespace cohort
