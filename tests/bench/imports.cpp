#include "tests/bench/imports.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/import/import.h"
#include "server/volume/geometry.h"
#include "server/volume/sample_order.h"
#include "tests/bench/timing.h"
#include "tests/support/deflate.h"
#include "tests/support/files.h"

namespace isomesh::bench {
namespace {

using Dims = std::array<std::uint32_t, 3>;

constexpr Dims kDims = {320, 320, 240};

struct Order {
  std::string_view name;  // nibabel's axis codes
  volume::AxisOrder axes;
};

constexpr std::array<Order, 6> kOrders = {{{"LPS", {1, 2, 3}},
                                           {"RAS", {-1, -2, 3}},
                                           {"LIA", {1, -3, -2}},
                                           {"PSL", {2, 3, 1}},
                                           {"PSR", {2, 3, -1}},
                                           {"SPL", {3, 2, 1}}}};

// Waves with noise, which gzip compresses about as well as a scan.
template <class Sample>
std::vector<Sample> scan() {
  std::vector<Sample> samples;
  samples.reserve(std::size_t{kDims[0]} * kDims[1] * kDims[2]);
  std::uint32_t noise = 1;
  for (std::uint32_t z = 0; z < kDims[2]; ++z) {
    for (std::uint32_t y = 0; y < kDims[1]; ++y) {
      for (std::uint32_t x = 0; x < kDims[0]; ++x) {
        noise = noise * 1664525U + 1013904223U;
        const double wave =
            900 * std::sin(x * 0.05) * std::cos(y * 0.03) + 500 * std::sin(z * 0.06);
        samples.push_back(
            static_cast<Sample>(static_cast<int>(wave) + static_cast<int>(noise >> 27)));
      }
    }
  }
  return samples;
}

template <class Number>
void put(std::string& header, std::size_t at, Number number) {
  header.replace(at, sizeof number, reinterpret_cast<const char*>(&number), sizeof number);
}

std::string nifti(const Dims& dims, const Geometry& geometry, std::size_t bytes_per_sample,
                  std::string_view samples) {
  constexpr std::size_t kHeaderBytes = 352;
  std::string file(kHeaderBytes, '\0');
  put(file, 0, std::int32_t{348});
  put(file, 40, std::int16_t{3});
  for (std::size_t axis = 0; axis < 3; ++axis) {
    put(file, 42 + axis * 2, static_cast<std::int16_t>(dims[axis]));
    put(file, 80 + axis * 4, static_cast<float>(geometry.spacing[axis]));
  }
  put(file, 70, static_cast<std::int16_t>(bytes_per_sample == 1 ? 2 : 4));  // uint8 or int16
  put(file, 72, static_cast<std::int16_t>(8 * bytes_per_sample));
  put(file, 108, static_cast<float>(kHeaderBytes));
  file[123] = 2;                    // millimetres
  put(file, 254, std::int16_t{1});  // the matrix is in RAS
  for (std::size_t row = 0; row < 3; ++row) {
    const double sign = row == 2 ? 1 : -1;
    for (int axis = 0; axis < 3; ++axis) {
      const double step = volume::step_of(geometry, axis)[row];
      put(file, 280 + row * 16 + static_cast<std::size_t>(axis) * 4,
          static_cast<float>(sign * step));
    }
    put(file, 292 + row * 16, static_cast<float>(sign * geometry.origin[row]));
  }
  file.replace(344, 3, "n+1");
  return file.append(samples);
}

void import(const std::filesystem::path& file) {
  const test::TemporaryFolder scratch(test::fast_place());
  import::import_volume(
      {.source = file, .scratch = scratch.path(), .target = scratch.path() / "canonical"});
}

// Two files with the same bytes of samples, because these decide how long gzip takes: one has its
// axes in this order, and the other one says that they are those of the patient.
struct Files {
  std::filesystem::path ordered, plain;
};

template <class Sample>
Files write(const test::TemporaryFolder& folder, const Order& order, std::vector<Sample> samples,
            bool is_gzip) {
  const auto bytes = std::as_writable_bytes(std::span(samples));
  const Geometry place = {.origin = {-110, -120, 30}, .spacing = {0.7, 0.7, 1}};
  volume::put_in_order(bytes, sizeof(Sample), kDims, order.axes);
  const auto write_with = [&](const Geometry& geometry, std::string_view suffix) {
    const std::string file = nifti(volume::in_order(kDims, order.axes), geometry, sizeof(Sample),
                                   {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    const std::filesystem::path path = folder / (std::string(order.name) + std::string(suffix));
    test::write_file(path, is_gzip ? test::gzip(file) : file);
    return path;
  };
  return {write_with(volume::in_order(kDims, place, order.axes), ".nii"),
          write_with(place, "-plain.nii")};
}

template <class Sample>
void measure(std::string_view type, bool is_gzip, Json& rows) {
  const std::vector<Sample> samples = scan<Sample>();
  const test::TemporaryFolder folder(test::fast_place());
  for (const Order& order : kOrders) {
    const Files files = write(folder, order, samples, is_gzip);
    const Paired times =
        time_in_pairs({[&] { import(files.ordered); }}, {[&] { import(files.plain); }});
    rows.push_back({{"axes", order.name},
                    {"type", type},
                    {"gzip", is_gzip},
                    {"import_ms", times.ours_ms},
                    {"plain_ms", times.peer_ms},
                    {"ratio", times.ratio}});
  }
}

}  // namespace

Json measure_imports() {
  Json rows = Json::array();
  for (const bool is_gzip : {false, true}) {
    measure<std::uint8_t>("uint8", is_gzip, rows);
    measure<std::int16_t>("int16", is_gzip, rows);
  }
  return rows;
}

}  // namespace isomesh::bench
