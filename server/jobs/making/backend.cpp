#include "server/jobs/making/backend.h"

#include <string>

#include "proto/error.h"
#include "proto/samples.h"

namespace isomesh::jobs {
namespace {

class Kernels : public Backend {
 public:
  std::string_view name() const override { return kDefaultBackend; }

  mesh::SurfaceSize count(const SampleArray& samples, const mesh::ExtractOptions& options,
                          const mesh::Context& context) const override {
    return with_sample(samples.type, [&](auto sample) {
      return size_of(count_surface(lattice_of<decltype(sample)>(samples), options, context));
    });
  }

  void extract(const SampleArray& samples, const mesh::ExtractOptions& options, const Admit& admit,
               const mesh::Context& context, mesh::Mesh& mesh) const override {
    constexpr double kCounting = 0.2;  // of the whole
    with_sample(samples.type, [&](auto sample) {
      const auto lattice = lattice_of<decltype(sample)>(samples);
      const mesh::SurfaceCount count = count_surface(lattice, options, context.part(0, kCounting));
      admit(size_of(count));
      extract_surface(lattice, options, count, context.part(kCounting, 1), mesh);
    });
  }

  mesh::SmoothingEffect smooth(const mesh::SmoothOptions& options, const mesh::Context& context,
                               mesh::Mesh& mesh) const override {
    return mesh::smooth(options, context, mesh);
  }
};

}  // namespace

const Backend& backend_of(std::string_view name) {
  static const Kernels kernels;
  if (name == kernels.name()) return kernels;
  throw Error(ErrorCode::kInternal, "there is no back end \"" + std::string(name) + '"');
}

}  // namespace isomesh::jobs
