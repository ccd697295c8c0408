#include <string>

#include "tests/bench/labels.h"
#include "tests/bench/peers.h"
#include "tests/bench/report_sections.h"
#include "tests/bench/report_text.h"

namespace isomesh::bench {
namespace {

constexpr std::uint32_t kBodySamples = 300;

std::string describe(const Samples& samples) {
  return "`" + samples.name + "`, " + std::to_string(samples.dims.x) + "x" +
         std::to_string(samples.dims.y) + "x" + std::to_string(samples.dims.z) + " " +
         std::string(to_string(samples.type));
}

}  // namespace

void write_labels(const std::filesystem::path& surface_nets_root, Report& report) {
  report.document.heading("Labels");
  report.document.paragraph(
      "All labels of a segmentation in one walk: `isomesh-bench labels`. The body is synthetic, "
      "104 "
      "ellipsoids and tubes that touch each other; the atlases are those of Debian's package "
      "mricron-data that are installed, with one layer of background around them, so that every "
      "surface is closed. Beside it *SurfaceNets*, vtkSurfaceNets3D with its " +
      std::to_string(kSurfaceNetsPasses) +
      " passes of smoothing, in a process of its own, and *a label*, one run of "
      "vtkDiscreteFlyingEdges3D for each label, smoothed each by itself with "
      "vtkWindowedSincPolyDataFilter as VTK's example GenerateModelsFromLabels does (15 passes, "
      "pass band 0.001). Times are from samples to vertices and triangles in memory; ours holds "
      "vertices to half the smallest spacing.");
  if (surface_nets_root.empty()) report.document.paragraph(kNoSurfaceNets);
  if (!peers_available()) report.document.paragraph(peers_description());
  const std::vector<Samples> all = segmentations(kBodySamples);
  const LabelPlan plan = {report.threads, surface_nets_root};
  std::vector<Finding> findings;
  for (const Samples& samples : all) {
    say("labels, " + samples.name);
    const auto more = measure_label_findings(samples, plan);
    findings.insert(findings.end(), more.begin(), more.end());
  }
  write_table(findings, report.document);
  report.document.paragraph(
      "*Gaps and overlaps*: points are put evenly into the cells whose corners do not all have one "
      "label, and counted in how many labels' surfaces each lies, by a ray's crossings. In more "
      "than one is an overlap. In none is a gap, where no sample of the cell and of those around "
      "it is background. *Volume* is what the surfaces enclose over what the voxels do: the sum of "
      "all, and the label where it is worst. SurfaceNets' triangles have no winding to tell it "
      "by.");
  for (const Samples& samples : all) {
    say("labels' gaps and overlaps, " + samples.name);
    report.document.paragraph("**" + describe(samples) + "**");
    report.document.table(quality_head(), quality_rows(measure_label_quality(samples, plan)));
  }
}

}  // namespace isomesh::bench
