// The seam between jobs and what computes their surfaces. Another back end, such as one for a
// graphics processor, is a class and a row in backend.cpp; jobs stay as they are.
#pragma once

#include <functional>
#include <string_view>

#include "server/jobs/making/sample_array.h"
#include "server/mesh/context.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/mesh.h"
#include "server/mesh/smooth/smooth.h"

namespace isomesh::jobs {

// The kernels of server/mesh. Results are stored as they were before there were other back ends.
inline constexpr std::string_view kDefaultBackend = "cpu";

// Stateless and thread safe. Meshes are as mesh.h says, and the same bytes for the same input; two
// back ends may differ in bytes. Every function throws Error kCancelled.
class Backend {
 public:
  virtual ~Backend() = default;

  // Part of the key of a result, so it never changes.
  virtual std::string_view name() const = 0;

  // How large the surface is; exact.
  virtual mesh::SurfaceSize count(const SampleArray& samples, const mesh::ExtractOptions& options,
                                  const mesh::Context& context) const = 0;

  // Makes the surface in `mesh`, whose memory is reused. Calls `admit` with its size before it
  // takes memory, and lets through what that throws.
  using Admit = std::function<void(const mesh::SurfaceSize&)>;
  virtual void extract(const SampleArray& samples, const mesh::ExtractOptions& options,
                       const Admit& admit, const mesh::Context& context,
                       mesh::Mesh& mesh) const = 0;

  // As mesh::smooth.
  virtual mesh::SmoothingEffect smooth(const mesh::SmoothOptions& options,
                                       const mesh::Context& context, mesh::Mesh& mesh) const = 0;
};

// Throws Error kInternal for an unknown name.
const Backend& backend_of(std::string_view name);

}  // namespace isomesh::jobs
