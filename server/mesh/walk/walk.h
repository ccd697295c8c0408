// One walk through the layers of a surface: it is extracted, smoothed and used window by window, so
// that it is never in memory as a whole. Memory follows the size of a layer, not the number of
// layers.
//
// A window is a run of layers. Windows are written in any order, by all threads. One thread at a
// time goes on with the steps of smoothing as windows come; each step is one layer behind the step
// before. When the vertices of a window can move no more, all threads work on its parts. The oldest
// window comes first, and a window is not begun while too many are in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/extract/windows.h"
#include "server/mesh/mesh.h"
#include "server/mesh/smooth/smooth.h"

namespace isomesh::mesh {

struct Window {
  std::uint32_t first_layer = 0;  // of the surface, as the next two
  std::uint64_t first_vertex = 0;
  std::uint64_t first_triangle = 0;
  // As LayerSource::write leaves it, then with the vertices of the layer behind it.
  Mesh mesh;
  // The triangles of the layer below the window, by its numbers, modulo 2^32.
  std::vector<Triangle> below;
  Buffer<Vec3> normals;  // of all its vertices, if they were asked for, as vertex_normals has them
};

struct WalkOptions {
  SmoothOptions smooth = {};
  std::uint32_t depth = 0;  // the layers of a window; 0 chooses it
  bool normals = false;
};

// Uses a surface.
class WindowUser {
 public:
  virtual ~WindowUser() = default;

  // The surface's next triangles, as they were extracted: [begin, end) of the mesh. By one thread
  // at a time.
  virtual void see_extracted(const Mesh& mesh, std::size_t begin, std::size_t end) = 0;

  // The next window, whose vertices move no more. Returns into how many parts the work on it is
  // divided. By one thread at a time.
  virtual std::size_t begin(const Window& window) = 0;

  // Does a part of that work, on several threads. What it returns is called by one thread at a
  // time, in the order of the windows and their parts; it does not use the window.
  using InOrder = std::function<void()>;
  virtual InOrder work(const Window& window, std::size_t part) = 0;
};

// The seconds that threads spent, added up.
struct WalkSeconds {
  double extracting = 0;
  double smoothing = 0;
  double using_it = 0;
};

struct WalkEnd {
  SmoothingEffect effect;
  WalkSeconds seconds;
};

// True if a walk can do such steps: all to the mean, or none.
bool can_walk(const SmoothOptions& options);

// Walks through the surface. The result, and what the user sees and does in order, does not depend
// on the number of threads, nor on the depth of windows. Throws Error kCancelled, after a window's
// stage at the latest, and what the user throws.
WalkEnd walk(LayerSource& surface, const WalkOptions& options, const Context& context,
             WindowUser& user);

// An upper bound of the memory of a walk, in bytes, with the present number of threads. Without the
// user's.
std::uint64_t walking_memory(const WalkOptions& options, const SurfaceSize& size,
                             const WritingMemory& writing);

}  // namespace isomesh::mesh
