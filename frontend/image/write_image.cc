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
  bool encoded = false;
  try {
    encoded = cv::imencode(file.extension().string(), picture, bytes, parameters);
  } catch (const cv::Exception&) {  // of a form whose sides are shorter
  }
  if (!encoded) {
    ThrowError("cannot write {}: OpenCV cannot encode a picture of {}x{} so",
               file.string(),
               picture.cols,
               picture.rows);
  }
  WriteBytes(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace cohort
