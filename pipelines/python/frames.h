#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

#include "datasets/readers/sequence.h"

namespace cohort {

// A NumPy array (height, width) or (height, width, 3) of uint8 or uint16 -> CV_8UC1 or CV_16UC1 of
// its own. `rgb`: three channels are red, green, blue; else OpenCV's blue, green, red. Throws Error
// naming `what` on any other object. The GIL is held.
cv::Mat GrayOfArray(const pybind11::object& object, bool rgb, const std::string& what);

// The arrays that a Python iterable gives, as a clip: numbered from 0, without names of files and
// time stamps. It asks for one after the other as they are needed, with the GIL, in the thread that
// calls Next, and keeps them in grey, as far as Rewind may ask for them again: `keep`. Made with the
// GIL; used and destroyed without.
std::unique_ptr<Sequence> SequenceOfArrays(const pybind11::object& iterable, bool rgb, bool keep);

}  // namespace cohort
