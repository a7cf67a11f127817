#include "pipelines/sfm/masks.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <system_error>
#include <utility>
#include <vector>

#include "datasets/readers/gray_image.h"
#include "datasets/readers/image_folder.h"
#include "frontend/core/error.h"
#include "frontend/image/read_image.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/input_record.h"
#include "frontend/tracks/frame_name.h"
#include "pipelines/json/json_file.h"
#include "pipelines/sfm/fingerprint.h"
#include "pipelines/sfm/fixed_parts.h"
#include "pipelines/sfm/fixed_pattern.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTransforms = "transforms.json";

// 255 where a grey picture is white, 0 where it is black.
cv::Mat WhiteOf(const cv::Mat& gray, const std::string& name) {
  double least = 0.0;
  double most = 0.0;
  cv::minMaxLoc(gray, &least, &most);
  const auto share = [&gray](const cv::Mat& where) {
    return static_cast<double>(cv::countNonZero(where)) / static_cast<double>(gray.total());
  };
  const double white = most > 255.0 ? 65535.0 : 255.0;
  // Of two values the darker one is black, as in masks of 0 and 1. Where such a mask of a frame has
  // one value alone, 1 is white.
  if (least == most)
    return cv::Mat(gray.size(), CV_8UC1, cv::Scalar(least == 1.0 || least > white / 2.0 ? 255 : 0));
  if (share((gray == least) | (gray == most)) == 1.0) return gray == most;
  // A picture of the clip, in the place of its mask, would mask at random.
  constexpr double kMostGray = 0.5;
  const double gray_share = share((gray > white / 4.0) & (gray < white * 3.0 / 4.0));
  if (gray_share > kMostGray) {
    ThrowError(
        "{} is not a mask: {:.0f} % of its pixels are neither black nor white; give a picture "
        "that is white where features are allowed and black elsewhere",
        name,
        100.0 * gray_share);
  }
  return gray > white / 2.0;
}

// Files below the folder, relative to it, in natural order. Hidden ones are left out.
std::vector<fs::path> PicturesBelow(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  fs::recursive_directory_iterator entry(folder, error);
  for (const fs::recursive_directory_iterator end; !error && entry != end; entry.increment(error)) {
    if (entry->path().filename().string().starts_with('.')) {
      entry.disable_recursion_pending();
      continue;
    }
    if (IsImageFile(entry->path()) && !entry->is_directory(error)) {
      files.push_back(entry->path().lexically_relative(folder));
    }
  }
  if (error) ThrowError("cannot read the masks in {}: {}", folder.string(), error.message());
  std::ranges::sort(files, [](const fs::path& a, const fs::path& b) {
    return NaturalLess(a.string(), b.string());
  });
  return files;
}

double ShareOfBlack(const cv::Mat& mask) {
  return 1.0 - static_cast<double>(cv::countNonZero(mask)) / static_cast<double>(mask.total());
}

std::string WithoutEnding(fs::path name) { return name.replace_extension().generic_string(); }

// The names of all frames of a source, as far as they are known before they are read.
std::vector<std::string> NamesOfFrames(const Sequence& sequence, bool whole) {
  std::vector<std::string> names;
  const fs::path root = sequence.ImageRoot();
  if (!root.empty()) {
    for (const fs::path& file : sequence.Files()) {
      if (IsImageFile(file)) names.push_back(file.lexically_relative(root).generic_string());
    }
  } else if (whole && !sequence.Files().empty()) {
    const std::size_t count = sequence.FrameCount().value_or(0);
    for (std::size_t i = 0; i < count; ++i) names.push_back(NumberedFrameName(FrameIndex(i)));
  }
  return names;
}

}  // namespace

cv::Mat ReadMask(const fs::path& file) {
  const std::string name = "the mask " + file.string();
  cv::Mat picture;
  cv::Mat gray;
  try {
    picture = ReadImage(file);
    gray = ToGray(picture, file.string());
  } catch (const SystemError&) {
    throw;
  } catch (const Error& error) {
    ThrowError("cannot read {}: give a picture ({})", name, error.what());
  }
  cv::Mat mask = WhiteOf(gray, name);
  const cv::Mat opaque = MaskOfAlpha(picture);
  return opaque.empty() ? mask : mask & opaque;
}

void CheckMaskIsOpen(const cv::Mat& mask, const std::string& name) {
  if (cv::countNonZero(mask) > 0) return;
  ThrowError(
      "{} is entirely black, which leaves no area for features: make it white where they are "
      "allowed",
      name);
}

ClipMasks::ClipMasks(const std::string& path) : name_(path) {
  if (path.empty()) return;
  std::error_code error;
  if (fs::is_directory(path, error)) {
    const fs::path transforms = fs::path(path) / kTransforms;
    if (fs::exists(transforms, error)) {
      ReadTransforms(transforms);
    } else {
      ReadFolder(path);
    }
  } else if (fs::path(path).extension() == ".json") {
    ReadTransforms(path);
  } else {
    mask_ = ReadMask(path);
    CheckMaskIsOpen(mask_, "the mask " + path);
    files_.emplace_back(path);
  }
  // At once rather than when they are read, which may be hours later.
  for (const fs::path& file : files_) InputRecord::Add(file);
}

ClipMasks::ClipMasks(cv::Mat mask, std::string name)
    : name_(std::move(name)), mask_(std::move(mask)) {}

void ClipMasks::Add(const fs::path& picture, const fs::path& file) {
  const auto add = [&file](auto& names, const std::string& name) {
    const auto [at, is_new] = names.emplace(name, file);
    if (!is_new && at->second != file) at->second.clear();
  };
  if (IsImageFile(picture)) {
    add(by_name_, picture.generic_string());
    if (picture.has_parent_path()) add(by_name_, picture.filename().string());
  }
  const std::string stem = WithoutEnding(picture);
  add(by_stem_, stem);
  if (picture.has_parent_path()) add(by_stem_, fs::path(stem).filename().string());
}

void ClipMasks::ReadFolder(const fs::path& folder) {
  for (const fs::path& name : PicturesBelow(folder)) {
    const fs::path without = WithoutEnding(name);
    // COLMAP's NAME.jpg.png is the mask of NAME.jpg, and NAME.png that of any picture NAME.
    Add(IsImageFile(without) ? without : fs::path(without.string() + "."), folder / name);
    files_.push_back(folder / name);
  }
  if (files_.empty()) {
    ThrowError(
        "no masks in {}: give a picture, or a folder with one mask per frame, such as NAME.png or "
        "NAME.jpg.png for the frame NAME.jpg",
        folder.string());
  }
}

void ClipMasks::ReadTransforms(const fs::path& file) {
  CheckInputFile(file);
  InputRecord::Add(file);
  UseJsonFile(file, [&](const nlohmann::ordered_json& json) {
    for (const nlohmann::ordered_json& frame : json.at("frames")) {
      if (!frame.contains("mask_path")) continue;
      const fs::path mask = file.parent_path() / frame["mask_path"].get<std::string>();
      Add(fs::path(frame.at("file_path").get<std::string>()).lexically_normal(), mask);
      files_.push_back(mask);
    }
  });
  if (files_.empty()) {
    ThrowError("{}: no frame has a mask_path: give the folder of the masks", file.string());
  }
}

fs::path ClipMasks::FileOf(const std::string& frame) const {
  const fs::path name = frame;
  const std::pair<const std::map<std::string, fs::path>*, std::string> ways[] = {
      {&by_name_, name.generic_string()},
      {&by_name_, name.filename().string()},
      {&by_stem_, WithoutEnding(name)},
      {&by_stem_, name.stem().string()}};
  for (const auto& [names, key] : ways) {
    const auto found = names->find(key);
    if (found == names->end()) continue;
    if (found->second.empty()) {
      ThrowError("{} has several masks of the frame {}: keep one", name_, frame);
    }
    return found->second;
  }
  return {};
}

cv::Mat ClipMasks::Of(const std::string& frame) const {
  if (!mask_.empty()) return mask_;
  const fs::path file = FileOf(frame);
  return file.empty() ? cv::Mat() : ReadMask(file);
}

void ClipMasks::CheckBelongTo(const Sequence& sequence, bool whole) const {
  if (!AreGiven() || !AreOnePerFrame()) return;
  const std::vector<std::string> names = NamesOfFrames(sequence, whole);
  if (names.empty()) return;
  std::vector<fs::path> used;
  for (const std::string& name : names) used.push_back(FileOf(name));
  std::ranges::sort(used);
  const bool none = used.back().empty();
  const auto unused = std::ranges::find_if(
      files_, [&used](const fs::path& file) { return !std::ranges::binary_search(used, file); });
  // A mask too few at the start and one too many at the end: numbers that count from 1 beside some
  // that count from 0. Each frame but the first would have the mask of the one before it.
  if (!none && (unused == files_.end() || !FileOf(names.front()).empty())) return;
  ThrowError(
      "the masks of {} are not named after the frames of {}: frame {} has no mask, and {} belongs "
      "to no frame; name each mask after its frame, such as {}.png",
      name_,
      sequence.Name(),
      names.front(),
      unused == files_.end() ? files_.front().string() : unused->string(),
      names.front());
}

std::string FingerprintOfMasks(const std::string& path) {
  if (path.empty()) return "";
  std::error_code error;
  if (fs::is_regular_file(path, error) && fs::path(path).extension() != ".json") {
    return FingerprintOfBytes(path);
  }
  return FingerprintOfBytes(ClipMasks(path).files());
}

MaskedSequence::MaskedSequence(std::unique_ptr<Sequence> sequence,
                               ClipMasks masks,
                               bool whole,
                               FixedPartsMask fixed_parts)
    : ForwardingSequence(std::move(sequence)),
      masks_(std::move(masks)),
      look_for_fixed_parts_(fixed_parts == FixedPartsMask::kFind),
      warning_(inner().Warning()) {
  masks_.CheckBelongTo(inner(), whole);
}

std::optional<Frame> MaskedSequence::Next() {
  if (look_for_fixed_parts_) {
    look_for_fixed_parts_ = false;
    const WhatStays stays = FindWhatStays(inner());
    pattern_ = stays.pattern;
    if (!stays.parts.empty()) {
      mask_of_fixed_parts_ = MaskOfFixedParts(stays.parts);
      paint_over_ = PaintOver(stays.parts);
    }
  }
  std::optional<Frame> frame = inner().Next();
  if (!frame) {
    if (!of_clip_) End();
    Join(inner().Warning());
    return std::nullopt;
  }
  if (masks_.AreGiven()) AddMask(*frame);
  ++count_.frames;
  if (!frame->mask.empty()) count_.covered += ShareOfBlack(frame->mask);
  if (!mask_of_fixed_parts_.empty()) {
    frame->mask = frame->mask.empty() ? mask_of_fixed_parts_ : frame->mask & mask_of_fixed_parts_;
  }
  if (!mask_of_fixed_parts_.empty() || !pattern_.empty()) {
    if (frame->color.empty()) frame->color = frame->gray;
    frame->gray = frame->gray.clone();
    if (!pattern_.empty()) SubtractPattern(pattern_, frame->gray);
    paint_over_.Apply(frame->gray);
  }
  return frame;
}

void MaskedSequence::AddMask(Frame& frame) {
  const cv::Mat mask = masks_.Of(frame.name);
  if (mask.empty()) {
    if (count_.frames == count_.with_mask) count_.without = frame.name;
    return;
  }
  ++count_.with_mask;
  if (mask.size() != frame.gray.size()) {
    ThrowError("the mask {} is {}x{}, but the frames are {}x{}: give a mask of the frames' size",
               masks_.AreOnePerFrame() ? masks_.FileOf(frame.name).string() : masks_.name(),
               mask.cols,
               mask.rows,
               frame.gray.cols,
               frame.gray.rows);
  }
  frame.mask = frame.mask.empty() ? mask : frame.mask & mask;
}

void MaskedSequence::Rewind() {
  count_ = {};
  inner().Rewind();
}

void MaskedSequence::End() {
  of_clip_ = count_;
  const Count& count = *of_clip_;
  if (!masks_.AreGiven() || count.frames == 0) return;
  if (count.with_mask == 0) {
    ThrowError("{} has no mask of any frame of {}, such as {}.png",
               masks_.name(),
               inner().Name(),
               count.without);
  }
  if (count.covered == static_cast<double>(count.frames)) {
    ThrowError(
        "the masks of {} are entirely black, which leaves no area for features: make them white "
        "where they are allowed",
        masks_.name());
  }
  if (count.with_mask < count.frames) {
    warning_of_masks_ = fmt::format(
        "{} has no mask of {} of the {} frames, such as {}: features are allowed "
        "anywhere in them",
        masks_.name(),
        count.frames - count.with_mask,
        count.frames,
        count.without);
  }
  if (count.covered == 0.0) {
    warning_of_masks_ = fmt::format(
        "{} covers nothing: make masks black where no features are allowed", masks_.name());
  }
}

void MaskedSequence::Join(const std::string& warning) {
  const bool both = !warning.empty() && !warning_of_masks_.empty();
  warning_ = warning + (both ? "; " : "") + warning_of_masks_;
}

double MaskedSequence::CoveredShare() const {
  if (!of_clip_ || of_clip_->frames == 0) return 0.0;
  return of_clip_->covered / static_cast<double>(of_clip_->frames);
}

std::string MaskedSequence::FixedPartsFound() const {
  std::vector<std::string> found;
  if (!mask_of_fixed_parts_.empty()) {
    found.push_back(fmt::format(
        "{:.2g} % of the picture area stays fixed while the rest moves, such as text, bars or "
        "parts of the camera or the car: no feature is allowed there",
        100.0 * ShareOfBlack(mask_of_fixed_parts_)));
  }
  if (!pattern_.empty()) {
    found.push_back(
        fmt::format("the sensor adds a pattern of {:.2g} levels to every picture: it is subtracted",
                    cv::norm(pattern_) / std::sqrt(static_cast<double>(pattern_.total()))));
  }
  if (found.empty()) return "";
  return fmt::format("{}; --no-mask-fixed leaves the pictures as they are", fmt::join(found, "; "));
}

bool MaskedSequence::CoverTooMuch() const {
  // What is cut out by alpha may be small, and no-one exchanges it.
  constexpr double kMost = 0.85;
  return masks_.AreGiven() && CoveredShare() > kMost;
}

std::string MaskedSequence::Coverage() const {
  if (!of_clip_ || of_clip_->covered == 0.0) return "";
  const std::string& name = masks_.name();
  const double covered = CoveredShare();
  const std::string what = !masks_.AreGiven()        ? "alpha covers"
                           : masks_.AreOnePerFrame() ? fmt::format("the masks of {} cover", name)
                                                     : fmt::format("the mask {} covers", name);
  constexpr double kMost = 0.5;
  return fmt::format("{} {:.0f} % of the pictures: no feature is allowed there{}",
                     what,
                     100.0 * covered,
                     covered > kMost ? "; if the scene is there, exchange black and white" : "");
}

}  // namespace cohort
