#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

namespace cohort {

// Writes a picture in the format of its extension (.png, .jpg), with OpenCV's parameters. Throws
// Error naming the path if any of it cannot be written; cv::imwrite misses errors in the last
// bytes.
void WriteImage(const std::filesystem::path& file,
                const cv::Mat& picture,
                const std::vector<int>& parameters = {});

// The encoded bytes; nullopt if OpenCV cannot encode it, as in a format with a smaller size limit.
std::optional<std::vector<unsigned char>> EncodedImage(const std::string& ending,
                                                       const cv::Mat& picture,
                                                       const std::vector<int>& parameters = {});

}  // namespace cohort
