#include "pipelines/sfm/kept_frames.h"

#include <cstddef>
#include <utility>
#include <vector>

#include "datasets/readers/forwarding_sequence.h"

namespace cohort {
namespace {

std::size_t BytesOf(const cv::Mat& picture) { return picture.total() * picture.elemSize(); }

class KeptFrames final : public ForwardingSequence {
 public:
  using ForwardingSequence::ForwardingSequence;

  std::optional<Frame> Next() override {
    if (next_ < kept_.size()) return kept_[next_++];
    if (ended_) return std::nullopt;
    std::optional<Frame> frame = inner().Next();
    ended_ = !frame;
    if (!frame) return frame;
    frame->color.release();
    if (keeps_) Keep(*frame);
    return frame;
  }

  // While all frames that were read are kept, the source stays where it is.
  void Rewind() override {
    next_ = 0;
    if (keeps_) return;
    inner().Rewind();
    ended_ = false;
  }

 private:
  void Keep(const Frame& frame) {
    constexpr std::size_t kMostBytes = 256U << 20U;
    bytes_ += BytesOf(frame.gray) + BytesOf(frame.mask);
    if (bytes_ <= kMostBytes) {
      kept_.push_back(frame);
      ++next_;
      return;
    }
    keeps_ = false;
    kept_ = {};
    next_ = 0;
  }

  std::vector<Frame> kept_;  // the first frames of the clip
  std::size_t next_ = 0;     // of those kept
  std::size_t bytes_ = 0;
  bool keeps_ = true;
  bool ended_ = false;
};

}  // namespace

std::unique_ptr<Sequence> KeepFrames(std::unique_ptr<Sequence> sequence) {
  return std::make_unique<KeptFrames>(std::move(sequence));
}

}  // namespace cohort
