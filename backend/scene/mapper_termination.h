#pragma once

#include <cstdint>
#include <string>

#include "frontend/core/options.h"

namespace cohort {

enum class MapperTermination : std::uint8_t {
  kSuccess,       // one model of at least 80 % of the frames
  kPartial,       // a model of fewer frames
  kTooFewTracks,  // nothing to start from
  kStaticCamera,  // nothing moves by more than the noise
  kPureRotation,  // a rotation about the camera's centre explains all motion: no depth
  kNoStart,       // there is parallax, but no pair of frames gave a consistent model
  kWeakDepth,     // a model was found, but its depths are within their own uncertainty
  kNotRigid,      // a model was found, but it does not explain the parallax
};
inline constexpr ChoiceNames<MapperTermination, 8> kMapperTerminationNames{
    {{"success", MapperTermination::kSuccess},
     {"partial", MapperTermination::kPartial},
     {"too few tracks", MapperTermination::kTooFewTracks},
     {"static camera", MapperTermination::kStaticCamera},
     {"pure rotation", MapperTermination::kPureRotation},
     {"no start", MapperTermination::kNoStart},
     {"weak depth", MapperTermination::kWeakDepth},
     {"not rigid", MapperTermination::kNotRigid}}};

// How a step of the mapper ended, with a description that may be empty.
struct MapperEnd {
  MapperTermination termination = MapperTermination::kSuccess;
  std::string detail;
};

}  // namespace cohort
