#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

#include "datasets/readers/sequence.h"

namespace cohort {

// Copies a NumPy array (height, width) or (height, width, 3) of uint8 or uint16 to CV_8UC1 or
// CV_16UC1. `rgb`: three channels are red, green, blue; else OpenCV's blue, green, red. Throws
// Error naming `what` for any other object. The GIL must be held.
cv::Mat GrayOfArray(const pybind11::object& object, bool rgb, const std::string& what);

// The arrays of a Python iterable as a clip: numbered from 0, without file names and time stamps.
// It fetches them one by one as needed, with the GIL, in the thread that calls Next. With `keep` it
// stores them in grey, so that Rewind can repeat them. Made with the GIL; used and destroyed
// without.
std::unique_ptr<Sequence> SequenceOfArrays(const pybind11::object& iterable, bool rgb, bool keep);

}  // namespace cohort
