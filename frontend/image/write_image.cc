#include "frontend/image/write_image.h"

#include <opencv2/imgcodecs.hpp>
#include <string_view>

#include "frontend/core/error.h"
#include "frontend/core/output.h"

namespace cohort {

void WriteImage(const std::filesystem::path& file,
                const cv::Mat& picture,
                const std::vector<int>& parameters) {
  std::vector<unsigned char> bytes;
  if (!cv::imencode(file.extension().string(), picture, bytes, parameters)) {
    ThrowError("cannot write {}: OpenCV cannot encode it", file.string());
  }
  WriteBytes(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace cohort
