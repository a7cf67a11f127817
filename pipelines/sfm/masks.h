#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "datasets/readers/forwarding_sequence.h"
#include "pipelines/sfm/fixed_parts.h"

namespace cohort {

// CV_8UC1, 0 where no feature may be, of a picture that is black and transparent there. Of two
// values the darker one is black; of more, all below half of the range are, since JPEG and video
// store black as 1 or 16. Throws Error naming a file that is not a picture, or has more grey than
// black and white.
cv::Mat ReadMask(const std::filesystem::path& file);
// Throws Error if the mask of that name is entirely black.
void CheckMaskIsOpen(const cv::Mat& mask, const std::string& name);

// The masks of a clip, as --mask names them: a picture for all frames, or one per frame: in a
// folder, named as COLMAP (`NAME.jpg.png` of the frame NAME.jpg) or Nerfstudio (NAME with any
// ending) name them, or as the mask_path of a transforms.json, or of that of a folder.
class ClipMasks {
 public:
  ClipMasks() = default;
  // No masks without a path. Reads the picture for all frames, or the names of those of single
  // frames. Throws Error naming what cannot be read.
  explicit ClipMasks(const std::string& path);
  // The picture for all frames, as CheckMaskIsOpen accepts it.
  ClipMasks(cv::Mat mask, std::string name);

  bool AreGiven() const { return !name_.empty(); }
  bool AreOnePerFrame() const { return mask_.empty(); }
  const std::string& name() const { return name_; }
  const std::vector<std::filesystem::path>& files() const { return files_; }
  // The file of the frame of that name; empty if it has none, or if there is one for all frames.
  std::filesystem::path FileOf(const std::string& frame) const;
  // The mask of that frame; empty if it has none.
  cv::Mat Of(const std::string& frame) const;
  // Throws Error if the masks are clearly named after other frames. `whole`: whether the sequence
  // has all frames of its source.
  void CheckBelongTo(const Sequence& sequence, bool whole) const;

 private:
  void ReadFolder(const std::filesystem::path& folder);
  void ReadTransforms(const std::filesystem::path& file);
  void Add(const std::filesystem::path& picture, const std::filesystem::path& file);

  std::string name_;
  cv::Mat mask_;
  std::vector<std::filesystem::path> files_;
  // By the picture's name, and by that without its ending. Empty: two files have it.
  std::map<std::string, std::filesystem::path> by_name_;
  std::map<std::string, std::filesystem::path> by_stem_;
};

// Changes with the bytes of all masks that --mask names; empty without a path.
std::string FingerprintOfMasks(const std::string& path);

// Whether fixed parts of the pictures are masked (FixedParts).
enum class FixedPartsMask : std::uint8_t { kFind, kNone };

// A sequence whose frames have these masks, in addition to those of their alpha and of fixed parts.
class MaskedSequence final : public ForwardingSequence {
 public:
  // Fixed parts and a fixed pattern are looked for before the first frame is read. In Frame::gray,
  // parts are painted over (and masked), and the pattern is subtracted; the frame's own picture is
  // then Frame::color.
  MaskedSequence(std::unique_ptr<Sequence> sequence,
                 ClipMasks masks,
                 bool whole = true,
                 FixedPartsMask fixed_parts = FixedPartsMask::kNone);

  // Throws Error naming a mask that cannot be read or has another size than the frame, and at the
  // end of the clip if no frame has a mask, or each is entirely black.
  std::optional<Frame> Next() override;
  void Rewind() override;
  // A sentence on what the masks and alpha cover; empty if there is neither, or before the end of
  // the clip has been reached once.
  std::string Coverage() const;
  // A sentence on the fixed parts and the pattern; empty if there are none.
  std::string FixedPartsFound() const;
  // Whether the masks cover so much that black and white are probably exchanged.
  bool CoverTooMuch() const;

  const std::string& Warning() const override { return warning_; }

 private:
  // Of the frames since the clip was rewound.
  struct Count {
    std::size_t frames = 0;
    std::size_t with_mask = 0;  // of its own
    double covered = 0.0;       // the sum of their shares
    std::string without;        // the first frame without a mask
  };
  void AddMask(Frame& frame);
  void End();
  void Join(const std::string& warning);
  double CoveredShare() const;  // of the whole clip

  ClipMasks masks_;
  bool look_for_fixed_parts_;
  cv::Mat mask_of_fixed_parts_;  // empty: there are none
  PaintOver paint_over_;
  cv::Mat pattern_;  // empty: there is none
  Count count_;
  std::optional<Count> of_clip_;  // at its end
  std::string warning_of_masks_;
  std::string warning_;  // with that of the sequence
};

}  // namespace cohort
