#include "tests/bench/samples.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "server/import/import.h"
#include "server/mesh/parallel.h"
#include "server/volume/canonical.h"
#include "tests/support/files.h"

namespace isomesh::bench {
namespace {

// sin and cos of `periods` turns over n samples.
struct Waves {
  Waves(std::uint32_t n, double periods) : sine(n), cosine(n) {
    for (std::uint32_t i = 0; i < n; ++i) {
      const double angle = 2 * std::numbers::pi * periods * i / (n - 1);
      sine[i] = static_cast<float>(std::sin(angle));
      cosine[i] = static_cast<float>(std::cos(angle));
    }
  }

  std::vector<float> sine;
  std::vector<float> cosine;
};

}  // namespace

LoadedVolume load_volume(const std::filesystem::path& path) {
  const test::TemporaryFolder scratch;
  const std::filesystem::path canonical = scratch.path() / "canonical";
  const Volume description =
      import::import_volume({.source = path, .scratch = scratch.path(), .target = canonical});
  const volume::CanonicalVolume file(canonical);
  LoadedVolume loaded;
  loaded.suggested_iso = description.suggested_iso;
  loaded.samples.name = path.filename().string();
  loaded.samples.type = description.type;
  loaded.samples.dims = {description.dims[0], description.dims[1], description.dims[2]};
  loaded.samples.geometry = description.geometry;
  const auto bytes = file.samples();
  loaded.samples.bytes.assign(bytes.begin(), bytes.end());
  return loaded;
}

Samples synthetic_field(std::uint32_t n) {
  constexpr double kPeriods = 2;
  constexpr double kFinePeriods = 5;
  constexpr float kFineWeight = 0.35F;
  constexpr float kGain = 60;  // the field reaches about 2 to either side
  const Waves coarse(n, kPeriods);
  const Waves fine(n, kFinePeriods);

  Samples field;
  field.name = "field-" + std::to_string(n);
  field.dims = {n, n, n};
  field.bytes.resize(std::size_t{n} * n * n);
  mesh::parallel_for({}, n, [&](std::size_t z) {
    for (std::size_t y = 0; y < n; ++y) {
      const float a = coarse.sine[y] * coarse.cosine[z];
      const float b = fine.sine[y] * fine.cosine[z];
      std::byte* row = field.bytes.data() + (z * n + y) * n;
      for (std::size_t x = 0; x < n; ++x) {
        const float broad =
            coarse.sine[x] * coarse.cosine[y] + a + coarse.sine[z] * coarse.cosine[x];
        const float narrow = fine.sine[x] * fine.cosine[y] + b + fine.sine[z] * fine.cosine[x];
        const float value = static_cast<float>(kFieldIso) + kGain * (broad + kFineWeight * narrow);
        row[x] = static_cast<std::byte>(std::clamp(value, 0.0F, 255.0F));
      }
    }
  });
  return field;
}

}  // namespace isomesh::bench
