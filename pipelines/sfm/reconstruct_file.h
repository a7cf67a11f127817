#pragma once

#include <string>

#include "pipelines/sfm/reconstruct.h"

namespace cohort {

// The options of `cohort reconstruct`.
struct ReconstructFileOptions {
  std::string tracks;
  std::string out;
  std::string json;
  ReconstructOptions reconstruct;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("tracks", o.tracks, "The .tracks file to reconstruct.", Tier::kCommon);
    v.Text("out", o.out, "The model folder to write.", Tier::kCommon);
    v.Text("json", o.json, "Also write the figures of the run to this file.", Tier::kCommon);
    ReconstructOptions::Visit(o.reconstruct, v);
  }
};

// Makes a model folder from .tracks. A clip that does not reconstruct is a result, which states
// why.
ReconstructResult ReconstructFile(const ReconstructFileOptions& options,
                                  const JobReport& report = {});

}  // namespace cohort
