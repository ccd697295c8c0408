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

// One axis of a resampling: between which two samples each new one lies, and how far along.
struct AxisMap {
  AxisMap(std::uint32_t from, std::uint32_t to) : low(to), share(to) {
    for (std::uint32_t i = 0; i < to; ++i) {
      const double place = static_cast<double>(i) * (from - 1) / (to - 1);
      low[i] = std::min(static_cast<std::uint32_t>(place), from - 2);
      share[i] = static_cast<float>(place - low[i]);
    }
  }

  std::vector<std::uint32_t> low;
  std::vector<float> share;
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

Samples resample(const Samples& samples, const mesh::Dims& dims) {
  const mesh::Dims from = samples.dims;
  const AxisMap x_map(from.x, dims.x);
  const AxisMap y_map(from.y, dims.y);
  const AxisMap z_map(from.z, dims.z);

  Samples result;
  result.name = samples.name;
  result.type = SampleType::kFloat32;
  result.dims = dims;
  result.geometry = samples.geometry;
  result.geometry.spacing[0] *= (from.x - 1.0) / (dims.x - 1.0);
  result.geometry.spacing[1] *= (from.y - 1.0) / (dims.y - 1.0);
  result.geometry.spacing[2] *= (from.z - 1.0) / (dims.z - 1.0);
  result.bytes.resize(dims.samples() * sizeof(float));
  auto* out = reinterpret_cast<float*>(result.bytes.data());
  visit_samples(samples, [&](const auto* in) {
    const std::size_t row = from.x;
    const std::size_t plane = row * from.y;
    for (std::uint32_t k = 0; k < dims.z; ++k) {
      for (std::uint32_t j = 0; j < dims.y; ++j) {
        for (std::uint32_t i = 0; i < dims.x; ++i) {
          const auto* corner = in + z_map.low[k] * plane + y_map.low[j] * row + x_map.low[i];
          const auto along_x = [&](std::size_t offset) {
            return std::lerp(static_cast<float>(corner[offset]),
                             static_cast<float>(corner[offset + 1]), x_map.share[i]);
          };
          const float near = std::lerp(along_x(0), along_x(row), y_map.share[j]);
          const float far = std::lerp(along_x(plane), along_x(plane + row), y_map.share[j]);
          *out++ = std::lerp(near, far, z_map.share[k]);
        }
      }
    }
  });
  return result;
}

}  // namespace isomesh::bench
