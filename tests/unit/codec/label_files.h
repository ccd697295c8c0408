// Labels for the files of all of them.
#pragma once

#include <algorithm>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/formats.h"
#include "server/codec/label_zip.h"
#include "server/mesh/smooth/smooth.h"
#include "tests/support/kernels.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::test {

// Some labels that touch each other, smoothed; the second has a name and a colour.
class LabelFilesTest : public testing::Test {
 public:
  using Places = std::set<mesh::Vec3>;

  static constexpr std::size_t kLabels = 5;

 protected:
  LabelFilesTest() {
    const auto volume = mesh::label_cells(kLabels, {30, 26, 28}, 12, 401);
    mesh::separate_into(walls_, volume,
                        {mesh::consecutive<std::int64_t>(1, kLabels), Scheme::kSix, true});
    smooth({.steps = test::means(4, {0.5})}, {}, walls_.mesh);
    surfaces_ = label_surfaces(walls_, {});
    for (const mesh::LabelMeasure& measure : measure_labels(walls_, surfaces_, {})) {
      const auto label = static_cast<std::int64_t>(labels_.size() + 1);
      labels_.push_back({.label = label,
                         .voxels = 10 * static_cast<std::uint64_t>(label),
                         .triangles = measure.triangles,
                         .vertices = measure.vertices,
                         .closed = measure.is_closed(),
                         .manifold = measure.topology.manifold,
                         .oriented = measure.topology.oriented,
                         .area_mm2 = measure.extent.area_mm2,
                         .volume_mm3 = measure.extent.volume_mm3});
    }
    labels_[1].name = "Left ventr\u00edculo";
    labels_[1].color = "#ff8000";
    provenance_.samples = "abc";
    provenance_.parameters = label_parameters({});
  }

  codec::LabelledSurface surface() const { return {walls_, surfaces_, labels_}; }

  mesh::Mesh surface_of(std::size_t number) const {
    return std::move(label_surfaces(walls_, {})[number - 1].mesh);
  }

  std::string encoded(MeshFormat format) const {
    std::string bytes;
    codec::encode_labels(surface(), format, provenance_, {}, [&](std::span<const std::byte> piece) {
      bytes.append(reinterpret_cast<const char*>(piece.data()), piece.size());
    });
    return bytes;
  }

  std::size_t faces_of_all() const {
    std::size_t faces = 0;
    for (const LabelSummary& label : labels_) faces += label.triangles;
    return faces;
  }

  struct Zip {
    std::string bytes;
    std::vector<codec::LabelFiles> files;
  };

  Zip zipped(const std::vector<MeshFormat>& formats) const {
    Zip zip;
    zip.files = codec::encode_labels_zip(
        surface(), formats, provenance_, {}, [&](std::span<const std::byte> piece) {
          zip.bytes.append(reinterpret_cast<const char*>(piece.data()), piece.size());
        });
    return zip;
  }

  // The places that both labels have, as extraction and smoothing left them.
  Places shared_places(std::size_t a, std::size_t b) const {
    Places shared;
    for (std::size_t t = 0; t < walls_.sides.size(); ++t) {
      if (walls_.sides[t] !=
          mesh::WallSides{static_cast<std::uint16_t>(a), static_cast<std::uint16_t>(b)})
        continue;
      for (const std::uint32_t v : walls_.mesh.triangles[t])
        shared.insert(walls_.mesh.positions[v]);
    }
    return shared;
  }

  // Each pair of neighbours must share as many places as their wall has. Quantisation may merge 1 %
  // of them.
  void expect_shared(const std::vector<Places>& decoded) const {
    std::size_t neighbours = 0;
    for (std::size_t a = 1; a <= kLabels; ++a) {
      for (std::size_t b = a + 1; b <= kLabels; ++b) {
        const std::size_t shared = shared_places(a, b).size();
        if (shared == 0) continue;
        ++neighbours;
        Places both;
        std::ranges::set_intersection(decoded[a - 1], decoded[b - 1],
                                      std::inserter(both, both.end()));
        EXPECT_GE(both.size(), shared - shared / 100) << a << " and " << b;
      }
    }
    EXPECT_GT(neighbours, 2U);
  }

  mesh::SeparatingSurface walls_;
  std::vector<mesh::LabelSurface> surfaces_;
  std::vector<LabelSummary> labels_;
  codec::Provenance provenance_;
};

}  // namespace isomesh::test
