#include "tests/bench/paper_tables.h"

#include <array>
#include <optional>

#include "tests/bench/paper.h"
#include "tests/bench/peers.h"
#include "tests/bench/stages.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

constexpr int kPasses = 5;
constexpr int kRuns = 5;
constexpr int kPeerRuns = 3;
constexpr int kFewestSincPasses = 5;  // with fewer the filter finds no coefficients
constexpr std::size_t kPaperSubTables = 250;
constexpr double kMostSearchSteps = 6e9;  // triangles that the search for neighbours looks at

// The paper's own surface of integer samples keeps its vertices off the samples when the iso-value
// is no integer. Which samples are inside does not change.
double off_the_samples(const Samples& samples, double iso) {
  return samples.type == SampleType::kFloat32 ? iso : iso - 0.5;
}

double paper_generation_ms(const Samples& samples, double iso, Scheme scheme, Soup& soup) {
  const Surface surface = {.iso = off_the_samples(samples, iso), .scheme = scheme};
  return time_ms({[&] { soup = extract_soup(samples, surface); }});
}

struct PaperTimes {
  double unique_ms = 0;
  double neighbors_ms = 0;
  double passes_ms = 0;
};

// Empty when it would take minutes.
std::optional<PaperTimes> paper_smoothing(const Soup& soup, std::size_t sub_tables, int passes) {
  PaperTimes times;
  IndexedMesh mesh;
  times.unique_ms = time_ms({[&] { mesh = find_unique(soup, sub_tables); }});
  if (mesh.search_steps() > kMostSearchSteps) return std::nullopt;
  NeighborLists neighbors;
  times.neighbors_ms = time_ms({[&] { neighbors = find_neighbors(mesh); }});
  times.passes_ms = time_ms({[&] { smooth(neighbors, passes, mesh); }});
  return times;
}

double flying_edges_ms(const Samples& samples, double iso, MeshSize* size = nullptr) {
  if (!peers_available()) return 0;
  Peers peers(samples, iso);
  peers.flying_edges();  // to warm up
  const double ms = median_ms({[&] { peers.flying_edges(); }, [&] { peers.release(); }}, kPeerRuns);
  if (size != nullptr) *size = peers.size();
  return ms;
}

// A cube of n^3 samples of the same box of space, n between 16 and 256, whose surface comes closest
// to that number of triangles.
Samples resample_for_triangles(const Samples& samples, double iso, std::uint64_t triangles) {
  const auto cube = [&](std::uint32_t n) { return resample(samples, {n, n, n}); };
  const auto count = [&](std::uint32_t n) {
    const Samples resampled = cube(n);
    return Stages(resampled, {.iso = iso}).count().triangles;
  };
  std::uint32_t low = 16;
  std::uint32_t high = 256;
  while (high - low > 1) {
    const std::uint32_t middle = (low + high) / 2;
    (count(middle) < triangles ? low : high) = middle;
  }
  return cube(triangles - count(low) < count(high) - triangles ? low : high);
}

Json passes_row(Stages& stages, std::optional<Peers>& peers, int passes) {
  const double ours_ms = median_ms({[&] {
                                     stages.extract();
                                     stages.smooth(passes);
                                   }},
                                   kRuns);
  const auto peer_ms = [&](bool is_possible, auto smooth) {
    if (!peers || !is_possible) return 0.0;
    return median_ms({[&] {
                        peers->flying_edges();
                        if (passes > 0) smooth();
                      },
                      [&] { peers->release(); }},
                     kPeerRuns);
  };
  const double smooth_ms = peer_ms(true, [&] { peers->smooth(passes); });
  const double sinc_ms =
      peer_ms(passes >= kFewestSincPasses, [&] { peers->windowed_sinc(passes); });
  return {{"passes", passes},
          {"isomesh_ms", ours_ms},
          {"peer_smooth_ms", if_measured(smooth_ms)},
          {"peer_sinc_ms", if_measured(sinc_ms)}};
}

}  // namespace

Json measure_schemes(const Subject& subject) {
  Json rows = Json::array();
  for (const Subject::Level& level : subject.levels) {
    const double peer_ms = flying_edges_ms(subject.samples, level.iso);
    for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
      Stages stages(subject.samples, {.iso = level.iso, .scheme = scheme});
      stages.extract();  // to warm up
      constexpr int kSchemeRuns = 7;
      const double ours_ms = median_ms({[&] { stages.extract(); }}, kSchemeRuns);
      Stages joined(subject.samples, {.iso = level.iso, .scheme = scheme, .regularize = true});
      joined.extract();
      const double joined_ms = median_ms({[&] { joined.extract(); }}, kSchemeRuns);
      Soup soup;
      const double paper_ms = paper_generation_ms(subject.samples, level.iso, scheme, soup);
      rows.push_back({{"volume", title_of(subject.samples, level)},
                      {"tetrahedra", scheme == Scheme::kFive ? 5 : 6},
                      {"triangles", stages.size().triangles},
                      {"vertices", stages.size().vertices},
                      {"isomesh_ms", ours_ms},
                      {"regularized_triangles", joined.size().triangles},
                      {"regularized_vertices", joined.size().vertices},
                      {"regularized_ms", joined_ms},
                      {"paper_ms", paper_ms},
                      {"peer_ms", if_measured(peer_ms)}});
    }
  }
  return rows;
}

Json measure_unique(const Subject& head, std::span<const std::uint32_t> cubes) {
  Json rows = Json::array();
  for (const Subject::Level& level : head.levels) {
    for (const std::uint32_t n : cubes) {
      const Samples cube = resample(head.samples, {n, n, n});
      Stages stages(cube, {.iso = level.iso});
      stages.extract();
      std::size_t found = 0;
      const Soup soup = soup_of(stages.positions(), stages.triangles());
      const double search_ms =
          time_ms({[&] { found = find_unique(soup, kPaperSubTables).vertices.size(); }});
      MeshSize peer;
      flying_edges_ms(cube, level.iso, &peer);
      Stages joined(cube, {.iso = level.iso, .regularize = true});
      joined.extract();
      rows.push_back({{"volume", title_of(cube, level)},
                      {"triangles", stages.size().triangles},
                      {"vertices", stages.size().vertices},
                      {"regularized_triangles", joined.size().triangles},
                      {"regularized_vertices", joined.size().vertices},
                      {"paper_vertices", found},
                      {"paper_ms", search_ms},
                      {"peer_triangles", peer.triangles},
                      {"peer_vertices", peer.vertices}});
    }
  }
  return rows;
}

Json measure_sub_tables(const Subject& head, std::span<const std::uint64_t> triangles) {
  const double iso = head.levels.front().iso;
  Json rows = Json::array();
  for (const std::uint64_t target : triangles) {
    const Samples cube = resample_for_triangles(head.samples, iso, target);
    Stages stages(cube, {.iso = iso});
    stages.extract();
    const Soup soup = soup_of(stages.positions(), stages.triangles());
    for (const std::size_t count :
         {1U, 2U, 5U, 10U, 20U, 50U, 100U, 150U, 200U, 250U, 300U, 400U, 500U, 700U, 1000U}) {
      const auto times = paper_smoothing(soup, count, kPasses);
      if (!times) continue;
      rows.push_back({{"triangles", soup.size()},
                      {"sub_tables", count},
                      {"unique_ms", times->unique_ms},
                      {"neighbors_ms", times->neighbors_ms},
                      {"passes_ms", times->passes_ms}});
    }
  }
  return rows;
}

Json measure_without_sub_tables(const Subject& head, std::uint64_t triangles) {
  const double iso = head.levels.front().iso;
  const Samples cube = resample_for_triangles(head.samples, iso, triangles);
  Stages stages(cube, {.iso = iso});
  stages.extract();
  Json rows = {{{"name", "isomesh"},
                {"triangles", stages.size().triangles},
                {"smooth_ms", median_ms({[&] { stages.smooth(kPasses); }}, kRuns)}}};
  if (!peers_available()) return rows;
  Peers peers(cube, iso);
  peers.flying_edges();
  rows.push_back({{"name", "VTK"},
                  {"triangles", peers.size().triangles},
                  {"smooth_ms", median_ms({[&] { peers.smooth(kPasses); }}, kRuns)}});
  return rows;
}

Json measure_generation(const Subject& head, std::span<const std::uint64_t> triangles) {
  const double iso = head.levels.front().iso;
  Json rows = Json::array();
  for (const std::uint64_t target : triangles) {
    const Samples cube = resample_for_triangles(head.samples, iso, target);
    Soup soup;
    const double generation_ms = paper_generation_ms(cube, iso, Scheme::kSix, soup);
    for (const Json& ours : measure_passes({cube, {head.levels.front()}}, std::array{5, 10})) {
      const auto times = paper_smoothing(soup, kPaperSubTables, ours.at("passes"));
      Json paper_ms;
      if (times) {
        paper_ms = generation_ms + times->unique_ms + times->neighbors_ms + times->passes_ms;
      }
      rows.push_back({{"paper_triangles", target},
                      {"passes", ours.at("passes")},
                      {"triangles", soup.size()},
                      {"paper_ms", paper_ms},
                      {"isomesh_ms", ours.at("isomesh_ms")},
                      {"peer_ms", ours.at("peer_smooth_ms")}});
    }
  }
  return rows;
}

Json measure_passes(const Subject& subject, std::span<const int> passes) {
  const double iso = subject.levels.front().iso;
  Stages stages(subject.samples, {.iso = iso});
  stages.extract();
  std::optional<Peers> peers;
  if (peers_available()) peers.emplace(subject.samples, iso);
  Json rows = Json::array();
  for (const int count : passes) {
    Json row = {{"volume", title_of(subject.samples, subject.levels.front())}};
    row.update(passes_row(stages, peers, count));
    rows.push_back(row);
  }
  return rows;
}

}  // namespace isomesh::bench
