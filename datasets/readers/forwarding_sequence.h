#pragma once

#include <memory>
#include <utility>

#include "datasets/readers/sequence.h"

namespace cohort {

// A base for sequences that change the frames of another one: everything is that of the other.
class ForwardingSequence : public Sequence {
 public:
  explicit ForwardingSequence(std::unique_ptr<Sequence> sequence)
      : sequence_(std::move(sequence)) {}

  std::optional<Frame> Next() override { return sequence_->Next(); }
  void Rewind() override { sequence_->Rewind(); }
  bool CanRewind() const override { return sequence_->CanRewind(); }
  bool AnyThreadMayRead() const override { return sequence_->AnyThreadMayRead(); }
  std::string Name() const override { return sequence_->Name(); }
  std::vector<std::filesystem::path> Files() const override { return sequence_->Files(); }
  std::filesystem::path ImageRoot() const override { return sequence_->ImageRoot(); }
  std::optional<std::size_t> FrameCount() const override { return sequence_->FrameCount(); }
  std::optional<Camera> KnownCamera() const override { return sequence_->KnownCamera(); }
  std::optional<FocalGuess> FocalGuessOfFile() const override {
    return sequence_->FocalGuessOfFile();
  }
  RowOrder SensorRows() const override { return sequence_->SensorRows(); }
  const std::map<FrameIndex, Rigid3>& TrueCamFromWorld() const override {
    return sequence_->TrueCamFromWorld();
  }
  std::optional<cv::Mat> TrueDepth(FrameIndex frame) const override {
    return sequence_->TrueDepth(frame);
  }
  std::optional<cv::Mat> OccluderMask(FrameIndex frame) const override {
    return sequence_->OccluderMask(frame);
  }
  const std::string& Warning() const override { return sequence_->Warning(); }

 protected:
  Sequence& inner() { return *sequence_; }
  const Sequence& inner() const { return *sequence_; }

 private:
  std::unique_ptr<Sequence> sequence_;
};

}  // namespace cohort
