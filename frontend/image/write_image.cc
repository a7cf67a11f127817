#include "frontend/image/write_image.h"

#include <opencv2/imgcodecs.hpp>
#include <string_view>

#include "frontend/core/error.h"
#include "frontend/storage/output.h"

namespace cohort {

std::optional<std::vector<unsigned char>> EncodedImage(const std::string& ending,
                                                       const cv::Mat& picture,
                                                       const std::vector<int>& parameters) {
  std::vector<unsigned char> bytes;
  try {
    if (cv::imencode(ending, picture, bytes, parameters)) return bytes;
  } catch (const cv::Exception& error) {
    if (error.code == cv::Error::StsNoMem) throw;
  }
  return std::nullopt;
}

void WriteImage(const std::filesystem::path& file,
                const cv::Mat& picture,
                const std::vector<int>& parameters) {
  const auto bytes = EncodedImage(file.extension().string(), picture, parameters);
  if (!bytes) {
    ThrowError("cannot write {}: OpenCV cannot encode a picture of {}x{} in this format",
               file.string(),
               picture.cols,
               picture.rows);
  }
  WriteBytes(file, {reinterpret_cast<const char*>(bytes->data()), bytes->size()});
}

}  // namespace cohort
