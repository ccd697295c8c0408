#include "server/jobs/making/thin_walls.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "proto/samples.h"
#include "server/jobs/making/mesh_stages.h"
#include "server/mesh/extract/open_cavities.h"
#include "server/mesh/parallel.h"

namespace isomesh::jobs {
namespace {

using Open = mesh::CavityCount::Open;

// The most samples of all boxes that are searched, in multiples of the volume's: boxes overlap.
constexpr std::uint64_t kMostSearches = 4;

// The most schemes that are compared with the job's in one search.
constexpr std::size_t kMostOthers = 2;

// The cavities that a surface leaves open, and those that another scheme would.
struct ThinWalls {
  Open open;
  std::optional<Scheme> better = {};  // the scheme that leaves the fewest open
  Open still_open = {};               // with that one

  void add(const ThinWalls& other) {
    open.cavities += other.open.cavities;
    open.samples += other.open.samples;
  }
};

// `others`: in the order of preference.
ThinWalls find_thin_walls(const mesh::SignRows& rows, Scheme scheme, std::span<const Scheme> others,
                          const mesh::Context& context) {
  ThinWalls walls = {count_cavities(rows, std::array{scheme}, context).open.front()};
  if (walls.open.cavities == 0) return walls;
  const auto open = count_cavities(rows, others, context).open;
  const auto least = std::ranges::min_element(open, {}, &Open::cavities);
  if (least->cavities >= walls.open.cavities) return walls;
  walls.better = others[static_cast<std::size_t>(least - open.begin())];
  walls.still_open = *least;
  return walls;
}

std::string cavities_text(std::uint64_t count) {
  return std::to_string(count) + (count == 1 ? " cavity" : " cavities");
}

std::string open_text(const Open& open) {
  return cavities_text(open.cavities) + " of " + std::to_string(open.samples) + " voxels that " +
         (open.cavities == 1 ? "is" : "are") + " closed by faces of voxels " +
         (open.cavities == 1 ? "is" : "are") + " open in the surface";
}

std::string remedy_text(const ThinWalls& walls) {
  if (!walls.better) return "No other scheme closes more of them.";
  const std::string scheme =
      "scheme=" + std::string(to_string(static_cast<SchemeName>(*walls.better)));
  if (walls.still_open.cavities > 0) {
    return scheme + " leaves " + std::to_string(walls.still_open.cavities) + " of them open.";
  }
  return scheme + " closes " + (walls.open.cavities == 1 ? "it." : "them.");
}

constexpr std::string_view kCause =
    "Walls are thinner there than the longest edges of the lattice. ";

// Those of the schemes that are not the job's.
std::vector<Scheme> others_of(std::vector<Scheme> schemes, Scheme scheme) {
  std::erase(schemes, scheme);
  return schemes;
}

// The box of a label and a sample around it, where the volume has one.
struct Box {
  std::array<std::uint32_t, 3> low = {};
  std::array<std::uint32_t, 3> size = {};

  std::uint64_t samples() const { return std::uint64_t{size[0]} * size[1] * size[2]; }
};

Box box_of(const mesh::LabelVoxels& label, const mesh::Dims& volume) {
  const std::array dims = {volume.x, volume.y, volume.z};
  Box box = {.low = label.low};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.low[axis] -= std::min<std::uint32_t>(box.low[axis], 1);
    box.size[axis] = std::min(label.high[axis] + 2, dims[axis]) - box.low[axis];
  }
  return box;
}

// The indices of the labels that are searched: those with the smallest boxes.
std::vector<std::size_t> searched_labels(std::span<const mesh::LabelVoxels> labels,
                                         const mesh::Dims& volume) {
  std::vector<std::pair<std::uint64_t, std::size_t>> boxes;
  for (std::size_t n = 0; n < labels.size(); ++n) {
    boxes.emplace_back(box_of(labels[n], volume).samples(), n);
  }
  std::ranges::sort(boxes);
  std::vector<std::size_t> searched;
  std::uint64_t rest = kMostSearches * volume.samples();
  for (const auto& [samples, n] : boxes) {
    if (samples > rest) break;
    rest -= samples;
    searched.push_back(n);
  }
  return searched;
}

// The values that samples of the type can have, ascending. Others are left out.
template <class T>
std::vector<T> samples_with(const std::vector<std::int64_t>& values) {
  std::vector<T> own;
  for (const std::int64_t value : values) {
    if (std::in_range<T>(value)) own.push_back(static_cast<T>(value));
  }
  std::ranges::sort(own);
  return own;
}

// The bits of the samples, 64 at most, that have one of the values.
template <class T>
std::uint64_t bits_of(std::span<const T> samples, const std::vector<T>& values) {
  std::uint64_t bits = 0;
  if (values.size() == 1) {
    for (std::size_t x = 0; x < samples.size(); ++x) {
      bits |= std::uint64_t{samples[x] == values.front()} << x;
    }
    return bits;
  }
  // Neighbours mostly have the same value, so few of them are looked up.
  std::uint64_t is_own = 0;
  for (std::size_t x = 0; x < samples.size(); ++x) {
    if (x == 0 || samples[x] != samples[x - 1]) {
      is_own = std::ranges::binary_search(values, samples[x]) ? 1 : 0;
    }
    bits |= is_own << x;
  }
  return bits;
}

template <class T>
mesh::SignRows rows_of(const mesh::Lattice<T>& lattice, const Box& box,
                       const std::vector<std::int64_t>& values) {
  const auto& [low, size] = box;
  const auto classify = [lattice, box, own = samples_with<T>(values)](
                            std::uint32_t y, std::uint32_t z, std::uint64_t* out) {
    const mesh::Dims& dims = lattice.dims;
    const std::size_t row = std::size_t{z + box.low[2]} * dims.y + y + box.low[1];
    const std::span samples(lattice.samples + row * dims.x + box.low[0], box.size[0]);
    for (std::size_t begin = 0; begin < samples.size(); begin += mesh::kFlagBits) {
      const std::size_t count = std::min<std::size_t>(mesh::kFlagBits, samples.size() - begin);
      *out++ = bits_of<T>(samples.subspan(begin, count), own);
    }
  };
  return {.dims = {size[0], size[1], size[2]},
          .parity = (low[0] + low[1] + low[2]) & 1,
          .classify = classify};
}

}  // namespace

std::vector<Note> notes_on_thin_walls(const SampleArray& samples, const MeshRequest& request,
                                      const mesh::Context& context) {
  const MeshParameters& parameters = request.parameters;
  if (!searches_cavities(samples, parameters, context)) return {};
  return with_sample(samples.type, [&](auto sample) -> std::vector<Note> {
    const auto lattice = lattice_of<decltype(sample)>(samples);
    const mesh::ExtractOptions options = extract_options(parameters, request.iso);
    const auto others = others_of({Scheme::kFive, Scheme::kBcc, Scheme::kSix}, options.scheme);
    const ThinWalls walls =
        find_thin_walls(sign_rows(lattice, options), options.scheme, others, context);
    if (walls.open.cavities == 0) return {};
    const std::string unfilled = parameters.fill_cavities ? ", and not filled. " : ". ";
    return {note_of(NoteCode::kThinWalls,
                    open_text(walls.open) + unfilled + std::string(kCause) + remedy_text(walls))};
  });
}

std::vector<Note> notes_on_thin_walls(const SampleArray& samples,
                                      std::span<const mesh::LabelVoxels> labels,
                                      const MeshParameters& parameters,
                                      const mesh::Context& context) {
  const Scheme scheme = scheme_of(parameters.scheme);
  const auto others = others_of({Scheme::kFive, Scheme::kSix}, scheme);
  std::vector<ThinWalls> found(labels.size());
  with_sample(samples.type, [&](auto sample) {
    using T = decltype(sample);
    if constexpr (std::is_integral_v<T>) {
      const auto lattice = lattice_of<T>(samples);
      const auto searched = searched_labels(labels, lattice.dims);
      mesh::parallel_for(context, searched.size(), [&](std::size_t at) {
        const std::size_t n = searched[at];
        const auto values = parameters.label_values.find(labels[n].label);
        const std::vector<std::int64_t> own =
            values == parameters.label_values.end() ? std::vector{labels[n].label} : values->second;
        found[n] = find_thin_walls(rows_of(lattice, box_of(labels[n], lattice.dims), own), scheme,
                                   others, context);
      });
    }
  });
  std::vector<Note> notes;
  constexpr std::size_t kMostTold = 8;
  ThinWalls rest;
  std::uint64_t further = 0;
  for (std::size_t n = 0; n < labels.size(); ++n) {
    if (found[n].open.cavities == 0) continue;
    if (notes.size() < kMostTold) {
      notes.push_back(note_of(NoteCode::kThinWalls, "Label " + std::to_string(labels[n].label) +
                                                        ": " + open_text(found[n].open) + ". " +
                                                        std::string(kCause) +
                                                        remedy_text(found[n])));
    } else {
      ++further;
      rest.add(found[n]);
    }
  }
  if (further > 0) {
    notes.push_back(note_of(NoteCode::kThinWalls, std::to_string(further) + " more labels: " +
                                                      open_text(rest.open) + '.'));
  }
  return notes;
}

bool searches_cavities(const SampleArray& samples, const MeshParameters& parameters,
                       const mesh::Context& context) {
  if (parameters.fill_cavities || !parameters.components.keeps_all()) return true;
  return with_sample(samples.type, [&](auto sample) {
    return is_mask(lattice_of<decltype(sample)>(samples), context);
  });
}

namespace {

std::uint64_t vertices_at_work(const mesh::SurfaceSize& surface) {
  return surface.most_vertices(mesh::kCavityPlanes + 1);
}

}  // namespace

std::uint64_t cavity_search_memory(const SampleArray& samples, const mesh::SurfaceSize& surface) {
  return mesh::cavity_search_memory({.dims = {samples.dims[0], samples.dims[1], samples.dims[2]},
                                     .vertices = surface.vertices,
                                     .vertices_at_work = vertices_at_work(surface),
                                     .schemes = kMostOthers});
}

std::uint64_t cavity_search_memory(const SampleArray& samples,
                                   std::span<const mesh::LabelVoxels> labels,
                                   const mesh::SurfaceSize& walls) {
  const mesh::Dims volume = {samples.dims[0], samples.dims[1], samples.dims[2]};
  const std::vector<std::size_t> searched = searched_labels(labels, volume);
  mesh::Dims largest = {};
  for (const std::size_t n : searched) {
    const auto [x, y, z] = box_of(labels[n], volume).size;
    largest = {std::max(largest.x, x), std::max(largest.y, y), std::max(largest.z, z)};
  }
  // A wall is in the surfaces of two labels.
  return mesh::cavity_search_memory(
      {.dims = largest,
       .vertices = 2 * walls.vertices,
       .vertices_at_work = 2 * vertices_at_work(walls),
       .schemes = kMostOthers,
       .at_once = std::min<std::uint64_t>(searched.size(),
                                          static_cast<std::uint64_t>(mesh::thread_count()))});
}

}  // namespace isomesh::jobs
