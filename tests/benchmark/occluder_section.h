#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cohort {

struct OccluderOptions {
  std::filesystem::path clips;  // folder of the rendered clips room, corridor and tabletop
  std::filesystem::path work;
  std::vector<std::string> seeds;
  int jobs = 1;
};

// The section of the paper's page on points that a bar hides for a while. Runs what `work` does not
// hold yet.
std::string OccluderSection(const OccluderOptions& options);

}  // namespace cohort
