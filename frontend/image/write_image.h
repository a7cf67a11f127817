#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace cohort {

// A picture as its ending says (.png, .jpg), with OpenCV's parameters of it. Throws Error naming the path
// where any of it cannot be written: cv::imwrite is not told of the last bytes.
void WriteImage(const std::filesystem::path& file,
                const cv::Mat& picture,
                const std::vector<int>& parameters = {});

}  // namespace cohort
