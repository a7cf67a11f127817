#include "pipelines/python/frames.h"

#include <deque>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "datasets/readers/gray_image.h"
#include "frontend/core/error.h"
#include "frontend/geometry/camera_fault.h"
#include "frontend/tracks/frame_name.h"

namespace py = pybind11;

namespace cohort {
namespace {

class ArraySequence final : public Sequence {
 public:
  ArraySequence(const py::object& iterable, bool rgb, bool keep)
      : iterator_(py::iter(iterable)), rgb_(rgb), keep_(keep) {
    if (py::hasattr(iterable, "__len__")) count_ = py::len(iterable);
  }
  ~ArraySequence() override {
    const py::gil_scoped_acquire gil;
    iterator_ = py::object();
  }

  std::optional<Frame> Next() override {
    if (next_ < kept_.size()) return FrameOf(kept_[next_]);
    if (ended_) return std::nullopt;
    const std::string what = fmt::format("frame {}", next_);
    cv::Mat gray;
    {
      const py::gil_scoped_acquire gil;
      const auto item = py::reinterpret_steal<py::object>(PyIter_Next(iterator_.ptr()));
      if (item) {
        gray = GrayOfArray(item, rgb_, what);
      } else if (PyErr_Occurred() != nullptr) {
        throw py::error_already_set();
      }
    }
    if (gray.empty()) {
      ended_ = true;
      count_ = next_;
      return std::nullopt;
    }
    if (size_.empty()) size_ = gray.size();
    RequireSize(gray.size(), size_, what);
    if (keep_) kept_.push_back(gray);
    return FrameOf(gray);
  }

  void Rewind() override {
    Check(keep_ || next_ == 0, "frames that are asked for again are kept");
    next_ = 0;
  }

  bool CanRewind() const override { return keep_; }
  bool AnyThreadMayRead() const override { return ended_; }
  std::string Name() const override { return "the frames given"; }
  std::filesystem::path ImageRoot() const override { return {}; }
  std::optional<std::size_t> FrameCount() const override { return count_; }
  std::optional<Camera> KnownCamera() const override { return std::nullopt; }
  const std::map<FrameIndex, Rigid3>& TrueCamFromWorld() const override { return no_poses_; }
  std::optional<cv::Mat> TrueDepth(FrameIndex) const override { return std::nullopt; }
  std::optional<cv::Mat> OccluderMask(FrameIndex) const override { return std::nullopt; }
  const std::string& Warning() const override { return no_warning_; }

 private:
  Frame FrameOf(const cv::Mat& gray) {
    const auto index = static_cast<FrameIndex>(next_++);
    return {index, 0, NumberedFrameName(index), gray};
  }

  py::object iterator_;
  bool rgb_;
  bool keep_;
  std::deque<cv::Mat> kept_;
  std::optional<std::size_t> count_;
  std::size_t next_ = 0;
  bool ended_ = false;
  cv::Size size_;
  std::map<FrameIndex, Rigid3> no_poses_;
  std::string no_warning_;
};

}  // namespace

cv::Mat GrayOfArray(const py::object& object, bool rgb, const std::string& what) {
  if (!py::isinstance<py::array>(object)) {
    ThrowError("{} is a {}: give NumPy arrays of uint8 or uint16",
               what,
               std::string(py::str(py::type::of(object).attr("__name__"))));
  }
  const auto given = py::reinterpret_borrow<py::array>(object);
  const bool is_8_bit = py::isinstance<py::array_t<std::uint8_t>>(given);
  if (!is_8_bit && !py::isinstance<py::array_t<std::uint16_t>>(given)) {
    ThrowError("{} has {} pixels: give uint8 or uint16", what, std::string(py::str(given.dtype())));
  }
  const py::ssize_t channels = given.ndim() == 2 ? 1 : given.ndim() == 3 ? given.shape(2) : 0;
  const auto shape = [&] { return std::string(py::str(given.attr("shape"))); };
  if ((channels != 1 && channels != 3) || given.size() == 0 || given.shape(0) > kMaxPictureSidePx ||
      given.shape(1) > kMaxPictureSidePx) {
    ThrowError("{} has the shape {}: give (height, width) or (height, width, 3)", what, shape());
  }
  constexpr py::ssize_t kMostPixels = py::ssize_t{1} << 30;  // as for files
  if (given.shape(0) > kMostPixels / given.shape(1)) {
    ThrowError("{} has the shape {}: up to 2^30 pixels are supported", what, shape());
  }
  const py::array array = py::array::ensure(given, py::array::c_style);
  if (!array) ThrowError("out of memory: cannot copy {}, of shape {}", what, shape());
  const int depth = is_8_bit ? CV_8U : CV_16U;
  const cv::Mat picture(static_cast<int>(array.shape(0)),
                        static_cast<int>(array.shape(1)),
                        CV_MAKETYPE(depth, static_cast<int>(channels)),
                        const_cast<void*>(array.data()));  // only read
  if (channels == 1) return picture.clone();
  cv::Mat gray;
  cv::cvtColor(picture, gray, rgb ? cv::COLOR_RGB2GRAY : cv::COLOR_BGR2GRAY);
  return gray;
}

std::unique_ptr<Sequence> SequenceOfArrays(const py::object& iterable, bool rgb, bool keep) {
  return std::make_unique<ArraySequence>(iterable, rgb, keep);
}

}  // namespace cohort
