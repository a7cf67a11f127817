// A video in; tracks, cameras and points out.
#include <iostream>

#include "backend/colmap/model_io.h"
#include "datasets/open_sequence.h"
#include "pipelines/sfm/reconstruct.h"
#include "pipelines/sfm/track_sequence.h"

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::cerr << "usage: example VIDEO OUT\n";
    return 2;
  }
  const std::string video = argv[1];
  const std::string out = argv[2];
  // All features together, frame by frame; then each again where a reconstruction says that it is.
  const auto clip = cohort::OpenSequence(video);
  const cohort::TrackFile tracks = cohort::TrackSequence(*clip, {.source = video});
  cohort::WriteTrackFile(out + ".tracks", tracks);

  const cohort::ReconstructResult result = cohort::Reconstruct(tracks);
  cohort::WriteReconstruction(out, result.reconstruction);  // COLMAP opens it
  std::cout << tracks.tracks.features().size() << " tracks; " << result.summary.Brief() << "\n";
  return result.summary.Failed() ? 1 : 0;
} catch (const std::exception& error) {
  std::cerr << "example: error: " << error.what() << "\n";
  return 1;
}
