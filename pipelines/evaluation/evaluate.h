#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "datasets/open_sequence.h"

namespace cohort {

// The options of `cohort evaluate`.
struct EvaluateOptions {
  std::string subject;
  std::string truth;
  Layout layout = Layout::kAuto;
  double edge_px = 0.0;
  std::string json;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("subject", o.subject, "The .tracks file or the model folder to measure.", Tier::kCommon);
    v.Text("truth",
           o.truth,
           "The clip with true poses and, for the errors of tracks and points, true depth. A model "
           "can also be measured against another model of the same frames.",
           Tier::kCommon);
    v.Choice("layout",
             o.layout,
             kLayoutNames,
             "How to read the truth; only needed if its layout is not recognised.",
             Tier::kCommon);
    v.Number("edge_px",
             o.edge_px,
             0.0,
             100.0,
             "Treat tracks that begin closer than this to a depth discontinuity [px] as tracks "
             "without truth; 0: evaluate all tracks. Near a discontinuity, a tiny offset decides "
             "which surface is the true one.",
             Tier::kCommon);
    v.Text("json", o.json, "Also write the figures to this file.", Tier::kCommon);
  }
};

// Evaluates tracks or a model against the ground truth. Returns the figures, also written to
// `json`.
nlohmann::ordered_json Evaluate(const EvaluateOptions& options);

}  // namespace cohort
