#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

namespace cohort {

// A picture as its ending says (.png, .jpg), with OpenCV's parameters of it. Throws Error naming the path
// where any of it cannot be written: cv::imwrite is not told of the last bytes.
void WriteImage(const std::filesystem::path& file,
                const cv::Mat& picture,
                const std::vector<int>& parameters = {});

// Its bytes; none where OpenCV cannot, as of a form whose sides are shorter.
std::optional<std::vector<unsigned char>> EncodedImage(const std::string& ending,
                                                       const cv::Mat& picture,
                                                       const std::vector<int>& parameters = {});

}  // namespace cohort
