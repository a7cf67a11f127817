// Pictures of every kind that is read: as grey, their colours, and what EXIF says of the lens.
#include "datasets/readers/exif.h"
#include "datasets/readers/gray_image.h"
#include "frontend/image/read_image.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  Try([&] {
    Frame frame;
    const auto file = File("a.picture", bytes);
    ReadExifFocal(file);
    SetPicture(ReadImage(file), "a.picture", frame);
  });
}

}  // namespace cohort::fuzz
