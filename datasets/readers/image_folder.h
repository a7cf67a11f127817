#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/readers/image_list.h"

namespace cohort {

// By the file's extension: png, jpg, tif, pgm and the like.
bool IsImageFile(const std::filesystem::path& file);

// frame2 before frame10: runs of digits compare as numbers, everything else by its bytes.
bool NaturalLess(std::string_view a, std::string_view b);

// The names of a folder's images in natural order; sub-folders and hidden files are left out.
std::vector<std::string> ImageNames(const std::filesystem::path& folder);

// A folder of images, one image, or a glob such as dir/*.png, in natural order. Images have no time
// stamps: 30 frames a second are assumed. Throws Error if there is no image.
ImageList ListImageFolder(const std::filesystem::path& input);

// Whether the text has one of * ? [ {.
bool IsGlob(std::string_view text);

}  // namespace cohort
