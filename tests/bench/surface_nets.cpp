#include "tests/bench/surface_nets.h"

#include <stdexcept>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include "tests/support/process.h"

namespace isomesh::bench {
namespace {

namespace fs = std::filesystem;

// The first entry of a folder whose name begins so; empty when there is none.
fs::path find_entry(const fs::path& folder, std::string_view name) {
  std::error_code missing;
  for (const auto& entry : fs::directory_iterator(folder, missing)) {
    if (entry.path().filename().string().starts_with(name)) return entry.path();
  }
  return {};
}

// The folder of the libraries, which is named by the processor, and the loader in it.
std::pair<fs::path, fs::path> find_libraries(const fs::path& root) {
  std::error_code missing;
  for (const auto& entry : fs::directory_iterator(root / "usr/lib", missing)) {
    if (!entry.path().filename().string().ends_with("-linux-gnu")) continue;
    const fs::path loader = find_entry(entry.path(), "ld-linux");
    if (!loader.empty()) return {entry.path(), loader};
  }
  throw std::runtime_error(root.string() + " holds no Debian: there is no usr/lib/*/ld-linux*");
}

// Python of that root, run by that root's loader with that root's libraries.
std::vector<std::string> python_of(const fs::path& root) {
  const auto [libraries, loader] = find_libraries(root);
  const fs::path python = root / "usr/bin/python3";
  if (!fs::exists(python) || find_entry(libraries, "libvtkFiltersCore-9").empty()) {
    throw std::runtime_error(root.string() + " has no package python3-vtk9");
  }
  std::string path = libraries.string();
  for (const char* alternative : {"blas", "lapack"}) {
    path += ':' + (libraries / alternative).string();
  }
  return {loader.string(), "--library-path", path, python.string()};
}

}  // namespace

SurfaceNets::SurfaceNets(const fs::path& root, const Samples& samples,
                         const std::vector<std::int64_t>& labels, int threads)
    : command_(python_of(root)),
      environment_({"PYTHONHOME=" + (root / "usr").string(), "VTK_SMP_BACKEND_IN_USE=TBB",
                    "VTK_SMP_MAX_THREADS=" + std::to_string(threads)}) {
  const std::string bytes(reinterpret_cast<const char*>(samples.bytes.data()),
                          samples.bytes.size());
  test::write_file(folder_ / "samples", bytes);
  const mesh::Dims dims = samples.dims;
  const nlohmann::json order = {
      {"samples", folder_ / "samples"},      {"type", to_string(samples.type)},
      {"dims", {dims.x, dims.y, dims.z}},    {"origin", samples.geometry.origin},
      {"spacing", samples.geometry.spacing}, {"labels", labels},
      {"passes", kSurfaceNetsPasses}};
  command_.insert(command_.end(), {ISOMESH_SURFACE_NETS_SCRIPT, order.dump()});
}

double SurfaceNets::run_ms() {
  const test::Finished finished = test::run(command_, environment_);
  if (finished.status != 0) {
    throw std::runtime_error("surface_nets.py failed: " + finished.errors);
  }
  const auto answer = nlohmann::json::parse(finished.output);
  peak_bytes_ = answer.at("bytes").get<std::uint64_t>();
  return answer.at("milliseconds").get<double>();
}

}  // namespace isomesh::bench
