// Pictures of every kind that is read: as grey, and their colours.
#include "datasets/readers/gray_image.h"
#include "frontend/image/read_image.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  Try([&] {
    Frame frame;
    SetPicture(ReadImage(File("a.picture", bytes)), "a.picture", frame);
  });
}

}  // namespace cohort::fuzz
