#include "datasets/readers/image_list.h"

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "datasets/readers/gray_image.h"
#include "frontend/core/error.h"
#include "frontend/geometry/camera_fault.h"
#include "frontend/image/read_image.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/input_record.h"

namespace cohort {
namespace {

constexpr double kDepthUnitsPerMetre = 5000.0;
constexpr double kWhite = 65535.0;  // of 16 bits
constexpr std::array<double, 3> kWhiteOfFewer{255.0, 1023.0, 4095.0};

// The maximum over all colours, without the alpha channel.
double Brightest(const cv::Mat& picture) {
  cv::Mat colors = picture;
  if (picture.channels() == 4) cv::cvtColor(picture, colors, cv::COLOR_BGRA2BGR);
  double brightest = 0.0;
  cv::minMaxLoc(colors.reshape(1), nullptr, &brightest);
  return brightest;
}

class ImageListSequence final : public Sequence {
 public:
  ImageListSequence(ImageList list, const FrameRange& range)
      : list_(std::move(list)), range_(range), count_(range.Count(list_.images.size())) {
    if (list_.images.empty()) ThrowError("{} lists no images", list_.name);
    if (count_ == 0) {
      ThrowError("{} has {} frames, but the range starts at frame {}: give an earlier one",
                 list_.name,
                 list_.images.size(),
                 range.first);
    }
    CheckGeometry();
    for (const ImageList::Image& image : list_.images) {
      // At once rather than when it is read, which may be hours later.
      InputRecord::Add(list_.root / image.name);
      RequirePictureName(list_.name, image.name);
    }
    for (const auto* files : {&list_.depth_files, &list_.occluder_files}) {
      for (const auto& [frame, file] : *files) InputRecord::Add(file);
    }
    const auto back = std::ranges::adjacent_find(
        list_.images, std::ranges::greater(), &ImageList::Image::timestamp_ns);
    if (back != list_.images.end()) {
      Warn(
          fmt::format("{}: the time of {} is before that of {}, which is listed before it: frames "
                      "are read in the listed order",
                      list_.name,
                      std::next(back)->name,
                      back->name));
    }
    const cv::Mat first = ReadImage(ImageFile(range.first));
    size_ = first.size();
    if (first.depth() == CV_16U) white_ = WhiteOfClip();
    if (Camera* camera = list_.camera ? &*list_.camera : nullptr) {
      if (camera->width_px == 0) {
        camera->width_px = size_.width;
        camera->height_px = size_.height;
      }
      if (cv::Size(camera->width_px, camera->height_px) != size_) {
        ThrowError(
            "the calibration of {} is for {}x{}, but its images are {}x{}: use the one that "
            "belongs to these images",
            list_.name,
            camera->width_px,
            camera->height_px,
            size_.width,
            size_.height);
      }
    } else {
      focal_guess_ = FocalGuessOfPictures(ImageFile(range.first),
                                          ImageFile(range.first + (count_ - 1) * range.stride),
                                          {size_.width, size_.height});
    }
  }

  std::optional<Frame> Next() override {
    if (read_ == count_) return std::nullopt;
    const std::size_t i = range_.first + read_ * range_.stride;
    const std::string file = ImageFile(i).string();
    cv::Mat picture;
    try {
      picture = ReadImage(file);
    } catch (const SystemError&) {
      throw;  // otherwise the same clip might have more frames the next time
    } catch (const Error& e) {
      Warn(fmt::format("read {} frames of {}: {}", read_, count_, e.what()));
      count_ = read_;
      return std::nullopt;
    }
    RequireSize(picture.size(), size_, file);
    if (picture.depth() == CV_16U) SpreadToWhite(picture, file);
    ++read_;
    Frame frame{FrameIndex(i), list_.images[i].timestamp_ns, list_.images[i].name, {}};
    SetPicture(std::move(picture), file, frame);
    return frame;
  }

  void Rewind() override { read_ = 0; }
  std::string Name() const override { return list_.name; }
  std::vector<std::filesystem::path> Files() const override {
    std::vector<std::filesystem::path> files;
    if (!list_.times.empty()) files.push_back(list_.times);
    for (std::size_t i = 0; i < list_.images.size(); ++i) files.push_back(ImageFile(i));
    return files;
  }
  std::filesystem::path ImageRoot() const override { return list_.root; }
  std::optional<std::size_t> FrameCount() const override { return count_; }
  std::optional<Camera> KnownCamera() const override { return list_.camera; }
  std::optional<FocalGuess> FocalGuessOfFile() const override { return focal_guess_; }
  const std::map<FrameIndex, Rigid3>& TrueCamFromWorld() const override {
    return list_.cam_from_world;
  }

  std::optional<cv::Mat> TrueDepth(FrameIndex frame) const override {
    const auto found = list_.depth_files.find(frame);
    if (found == list_.depth_files.end()) return std::nullopt;
    const cv::Mat units = ReadImage(found->second);
    if (units.type() != CV_16UC1) {
      ThrowError("depth map {} is not a 16-bit grey image", found->second.string());
    }
    RequireSize(units.size(), size_, found->second.string());
    cv::Mat metres;
    units.convertTo(metres, CV_32F, 1.0 / kDepthUnitsPerMetre);
    return metres;
  }

  std::optional<cv::Mat> OccluderMask(FrameIndex frame) const override {
    const auto found = list_.occluder_files.find(frame);
    if (found == list_.occluder_files.end()) return std::nullopt;
    const std::string file = found->second.string();
    const cv::Mat mask = ToGray(ReadImage(file), file);
    RequireSize(mask.size(), size_, file);
    return cv::Mat(mask != 0);
  }

  const std::string& Warning() const override { return warning_; }

 private:
  // Checks the results of all layouts' computations: every number must be finite.
  void CheckGeometry() const {
    if (list_.camera) {
      if (const std::string fault = FaultOf(*list_.camera); !fault.empty()) {
        ThrowError("{}: {}", list_.name, fault);
      }
    }
    for (const auto& [frame, pose] : list_.cam_from_world) {
      if (!pose.translation.allFinite() || !pose.rotation.coeffs().allFinite()) {
        ThrowError("{}: the pose of frame {} is not finite", list_.name, ToInt(frame));
      }
    }
  }

  void Warn(const std::string& what) { warning_ += (warning_.empty() ? "" : "; ") + what; }

  std::filesystem::path ImageFile(std::size_t image) const {
    return list_.root / list_.images[image].name;
  }

  // Sensors of up to 12 bits often store their values in 16 bits with the upper ones empty, which
  // programs for 8 bits would take for black. The white level is estimated from some pictures of
  // the whole clip, independently of the range. Levels of more than 12 bits are not considered,
  // since a dark clip of 16 bits may have them.
  double WhiteOfClip() const {
    const std::size_t last = list_.images.size() - 1;
    const std::size_t steps = std::min<std::size_t>(15, last);  // to the last picture
    double brightest = 0.0;
    for (std::size_t i = 0; i <= steps && brightest <= kWhiteOfFewer.back(); ++i) {
      try {
        const cv::Mat picture = ReadImage(ImageFile(steps == 0 ? 0 : i * last / steps));
        if (picture.depth() == CV_16U) brightest = std::max(brightest, Brightest(picture));
      } catch (const SystemError&) {
        throw;
      } catch (const Error&) {  // Next reports it if it is in the range
      }
    }
    const auto* const white = std::ranges::lower_bound(kWhiteOfFewer, brightest);
    return white == kWhiteOfFewer.end() ? kWhite : *white;
  }

  void SpreadToWhite(cv::Mat& picture, const std::string& file) {
    if (white_ == kWhite) return;
    if (!warned_of_white_ && Brightest(picture) > white_) {
      warned_of_white_ = true;
      Warn(
          fmt::format("{} is brighter than {}, which is white according to other pictures of the "
                      "clip: brighter pixels are clipped; to avoid this, multiply all pictures of "
                      "the clip by one factor",
                      file,
                      white_));
    }
    picture.convertTo(picture, -1, kWhite / white_);
  }

  ImageList list_;
  FrameRange range_;
  std::size_t count_;     // frames of the range
  std::size_t read_ = 0;  // of them
  cv::Size size_;
  std::optional<FocalGuess> focal_guess_;
  double white_ = kWhite;  // of pictures of 16 bits
  bool warned_of_white_ = false;
  std::string warning_;
};

}  // namespace

std::string FolderName(const std::filesystem::path& folder) {
  const std::filesystem::path absolute = std::filesystem::weakly_canonical(folder);
  return (absolute.has_filename() ? absolute : absolute.parent_path()).filename().string();
}

std::unique_ptr<Sequence> OpenImageList(ImageList list, const FrameRange& range) {
  return std::make_unique<ImageListSequence>(std::move(list), range);
}

}  // namespace cohort
