// Our way through all labels of a segmentation.
#pragma once

#include <cstdint>
#include <vector>

#include "server/mesh/labels/label_surface.h"
#include "server/mesh/labels/label_voxels.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/smooth/smooth.h"
#include "tests/bench/samples.h"
#include "tests/bench/stages.h"

namespace isomesh::bench {

// A segmentation for the bench: the samples of a file with one layer of background around them, so
// that every label's surface is closed whoever makes it, and with the identity for directions,
// which VTK's filters do not know. Throws std::runtime_error when the type is no integer.
Samples load_labels(const std::filesystem::path& path);
Samples padded(const Samples& samples);

// By the parameters of a job by all labels, a job's defaults if there are none. In memory that is
// kept. Extract comes first. Background is 0. Not thread safe. Keeps a reference to the samples,
// whose type must be an integer.
class LabelStages {
 public:
  explicit LabelStages(const Samples& samples,
                       const MeshParameters& parameters = label_parameters({}));

  void count_voxels() const;
  void extract();
  void smooth(const mesh::SmoothOptions& options);
  void remove_stairs();              // the default of jobs by labels
  std::size_t count_folded() const;  // triangles, see unfold.h
  // Topology, area and volume of each label.
  std::vector<mesh::LabelMeasure> measure() const;
  // A job to a GLB.
  JobFigures run_job(bool certify = false);

  const MeshParameters& parameters() const { return parameters_; }
  const std::vector<std::int64_t>& labels() const { return options_.labels; }
  const std::vector<mesh::LabelVoxels>& voxels() const { return voxels_; }  // of those labels
  MeshSize size() const { return {surface_.mesh.positions.size(), surface_.mesh.triangles.size()}; }
  const mesh::SeparatingSurface& surface() const { return surface_; }

 private:
  const Samples& samples_;
  MeshParameters parameters_;
  std::vector<mesh::LabelVoxels> voxels_;
  mesh::SeparateOptions options_;
  mesh::SurfaceCount count_;
  mesh::SeparatingSurface surface_;
};

}  // namespace isomesh::bench
