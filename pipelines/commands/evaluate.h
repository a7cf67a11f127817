#pragma once

#include "datasets/readers/sequence.h"
#include "pipelines/console/command.h"

namespace cohort {

struct EvaluateCommandOptions {
  std::string subject;
  std::string truth;
  Layout layout = Layout::kAuto;
  double edge_px = 0.0;
  std::string json;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("subject", o.subject, "a .tracks file, or a model folder");
    v.Text("truth", o.truth, "the clip with true poses (and, for tracks and points, true depth)");
    v.Choice("layout", o.layout, kLayoutNames, "how to read the truth");
    v.Number("edge_px",
             o.edge_px,
             0.0,
             100.0,
             "tracks that begin nearer to a jump of depth count as without truth [px]; 0: none");
    v.Text("json", o.json, "file for the figures");
  }
};

// Tracks or a model against the truth.
void RunEvaluate(const EvaluateCommandOptions& options);

Command EvaluateCommand();

}  // namespace cohort
