#include "server/mesh/walk/walk.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "base/mutex.h"
#include "server/mesh/measure/normals.h"
#include "server/mesh/parallel.h"
#include "server/mesh/points.h"
#include "server/mesh/smooth/flat_triangles.h"
#include "server/mesh/smooth/layer_steps.h"

namespace isomesh::mesh {
namespace {

using Clock = std::chrono::steady_clock;

// Deeper windows number fewer planes twice, flatter ones take less memory.
constexpr std::uint64_t kUsualTriangles = std::uint64_t{1} << 18;  // of a window
constexpr std::uint32_t kFewestLayers = 4;
constexpr std::uint32_t kMostLayers = 32;
// A vertex stays where it is when so many layers behind it have been moved by all steps.
constexpr std::size_t kLayersUntilSettled = 4;

std::uint32_t usual_depth(std::uint64_t triangles, std::uint64_t layers) {
  const std::uint64_t deep = kUsualTriangles * layers / std::max<std::uint64_t>(1, triangles);
  // Enough of them for all threads.
  const std::uint64_t shared = layers / (4 * static_cast<std::uint64_t>(thread_count()));
  return static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(std::min(deep, shared), kFewestLayers, kMostLayers));
}

std::uint32_t depth_of(const WalkOptions& options, std::uint64_t triangles, std::uint64_t layers) {
  return options.depth == 0 ? usual_depth(triangles, layers) : options.depth;
}

// The windows in memory: one that is used, those that hold its layers up, and one for each thread.
std::size_t windows_at_once(const WalkOptions& options, std::uint32_t depth) {
  const std::size_t layers =
      options.smooth.steps.size() + kLayersUntilSettled + (options.normals ? 1 : 0);
  return 1 + (layers + depth - 1) / depth + static_cast<std::size_t>(thread_count());
}

class Walk {
 public:
  Walk(LayerSource& surface, const WalkOptions& options, const Context& context, WindowUser& user,
       std::uint32_t depth)
      : surface_(surface),
        context_(context),
        user_(user),
        threads_(static_cast<std::size_t>(thread_count())),
        depth_(depth),
        has_normals_(options.normals),
        count_((surface.layers() + depth - 1) / depth),
        slots_(std::min(count_, windows_at_once(options, depth))),
        results_(surface.layers()),
        layers_{[this](std::ptrdiff_t layer) { return view(layer); }, results_},
        steps_({options.smooth, 0, options.smooth.steps.size(),
                size_of(surface.count()).largest_layer()},
               {0, layers_.count()}, layers_),
        flat_(layers_),
        written_(count_, false) {
    make_room();
  }

  WalkEnd run() {
    // Tasks run on one thread each: a loop within one would take over others of these.
    parallel_for({context_.stop, nullptr}, threads_, [&](std::size_t /*thread*/) {
      const OneThread alone;
      work();
    });
    const Lock lock(mutex_);
    return {layers_.effect(surface_.count().vertices()), seconds_};
  }

 private:
  enum class Kind { kWrite, kSmooth, kUse, kEnd };
  struct Task {
    Kind kind;
    std::size_t window;
    std::size_t part;
    WindowUser::InOrder end;
  };

  std::uint32_t begin_of(std::size_t window) const {
    return static_cast<std::uint32_t>(window) * depth_;
  }
  std::uint32_t end_of(std::size_t window) const {
    return std::min(surface_.layers(), begin_of(window) + depth_);
  }
  Window& at(std::size_t window) { return slots_[window % slots_.size()]; }

  LayerView view(std::ptrdiff_t layer) {
    const auto index = static_cast<std::size_t>(layer);
    Mesh& mesh = at(index / depth_).mesh;
    const std::size_t own = index % depth_;
    return {&mesh, own, mesh.positions.data() + mesh.layer_vertices[own]};
  }

  // As much as the largest window needs: arrays that grew would leave holes.
  void make_room() {
    const SurfaceCount& count = surface_.count();
    std::uint64_t vertices = 0;
    std::uint64_t triangles = 0;
    for (std::size_t w = 0; w < count_; ++w) {
      const std::uint32_t behind = std::min(surface_.layers(), end_of(w) + 1);
      vertices =
          std::max(vertices, count.layer_vertices[behind] - count.layer_vertices[begin_of(w)]);
      triangles = std::max(triangles,
                           count.layer_triangles[end_of(w)] - count.layer_triangles[begin_of(w)]);
    }
    for (Window& slot : slots_) {
      slot.mesh.positions.resize_for_overwrite(vertices);
      slot.mesh.triangles.resize_for_overwrite(triangles);
      if (has_normals_) slot.normals.resize_for_overwrite(vertices);
    }
  }

  // Others wait for what a thread does, so any failure of one ends their waits.
  void work() {
    try {
      while (work_on_next()) {
      }
    } catch (...) {
      const Lock lock(mutex_);
      has_failed_ = true;
      changed_.notify_all();
      throw;
    }
  }

  // Returns false if there is nothing left to do.
  bool work_on_next() {
    Lock lock(mutex_);
    std::optional<Task> task;
    while (used_ < count_ && !has_failed_ && !(task = take())) changed_.wait(lock);
    if (!task) return false;
    lock.unlock();
    const Clock::time_point began = Clock::now();
    context_.throw_if_stopped();
    run(*task);
    lock.lock();
    complete(*std::move(task), std::chrono::duration<double>(Clock::now() - began).count());
    changed_.notify_all();
    return true;
  }

  void write(std::uint32_t begin, std::uint32_t end, Window& window) {
    window.first_layer = begin;
    window.first_vertex = surface_.count().layer_vertices[begin];
    window.first_triangle = surface_.count().layer_triangles[begin];
    surface_.write(begin, end, window.mesh);
  }

  // The task that brings the oldest window on, of those that can run now.
  std::optional<Task> take() ISOMESH_REQUIRES(mutex_) {
    if (const auto next = waiting_.find({used_, used_parts_});
        !is_ending_ && next != waiting_.end()) {
      is_ending_ = true;
      Task task = {Kind::kEnd, used_, used_parts_, std::move(next->second)};
      waiting_.erase(next);
      return task;
    }
    while (next_used_ < parts_.size() && next_part_ == parts_[next_used_]) {
      ++next_used_;
      next_part_ = 0;
    }
    // Parts that are done ahead of their turn wait in memory.
    if (next_used_ < parts_.size() && waiting_.size() < 2 * threads_) {
      return Task{Kind::kUse, next_used_, next_part_++, {}};
    }
    if (!is_smoothing_ && smoothed_ < count_ && written_[smoothed_]) {
      is_smoothing_ = true;
      return Task{Kind::kSmooth, smoothed_, 0, {}};
    }
    if (next_written_ < count_ && next_written_ < used_ + slots_.size()) {
      return Task{Kind::kWrite, next_written_++, 0, {}};
    }
    return std::nullopt;
  }

  void run(Task& task) {
    switch (task.kind) {
      case Kind::kWrite:
        return write(begin_of(task.window), end_of(task.window), at(task.window));
      case Kind::kSmooth:
        see(task.window);
        return smooth(task.window);
      case Kind::kUse:
        task.end = user_.work(at(task.window), task.part);
        return;
      case Kind::kEnd:
        return task.end();
    }
  }

  void complete(Task task, double seconds) ISOMESH_REQUIRES(mutex_) {
    switch (task.kind) {
      case Kind::kWrite:
        written_[task.window] = true;
        seconds_.extracting += seconds;
        return;
      case Kind::kSmooth:
        is_smoothing_ = false;
        ++smoothed_;
        parts_.insert(parts_.end(), begun_.begin(), begun_.end());
        begun_.clear();
        seconds_.smoothing += seconds;
        break;
      case Kind::kUse:
        waiting_[{task.window, task.part}] = std::move(task.end);
        seconds_.using_it += seconds;
        break;
      case Kind::kEnd:
        is_ending_ = false;
        ++used_parts_;
        seconds_.using_it += seconds;
        break;
    }
    // A window whose parts have all ended gives its memory to another.
    while (used_ < parts_.size() && used_parts_ == parts_[used_]) {
      ++used_;
      used_parts_ = 0;
    }
    if (context_.progress) {
      context_.progress(static_cast<double>(used_) / static_cast<double>(count_));
    }
  }

  // Copies what the next window has of its first layer's vertices to the place behind the window's.
  void copy_behind(std::size_t window, const std::function<Vec3*(Window&)>& values) {
    if (window + 1 == count_) return;
    const Mesh& mesh = at(window).mesh;
    const Mesh& next = at(window + 1).mesh;
    std::copy_n(values(at(window + 1)), next.layer_vertices[1],
                values(at(window)) + mesh.layer_vertices[mesh.layers() - 1]);
  }
  void copy_positions_behind(std::size_t window) {
    copy_behind(window, [](Window& of) { return of.mesh.positions.data(); });
  }

  // Shows triangles as they were extracted. The last layer of the window before has not moved yet.
  void see(std::size_t window) {
    Window& own = at(window);
    own.below.clear();
    if (window > 0) {
      copy_positions_behind(window - 1);
      const Mesh& below = at(window - 1).mesh;
      const std::size_t last = below.layers() - 2;
      user_.see_extracted(below, below.layer_triangles[last], below.layer_triangles[last + 1]);
      const auto behind = static_cast<std::uint32_t>(below.layer_vertices[last + 1]);
      const auto triangles = below.triangles_of(last, last + 1);
      own.below.reserve(triangles.size());
      for (const auto& [a, b, c] : triangles) {
        own.below.push_back({a - behind, b - behind, c - behind});
      }
      surface_.forget(begin_of(window - 1), end_of(window - 1));
    }
    const std::size_t layers = own.mesh.layers() - 1;
    const bool is_last = window + 1 == count_;
    user_.see_extracted(own.mesh, 0, own.mesh.layer_triangles[is_last ? layers : layers - 1]);
  }

  void smooth(std::size_t window) {
    steps_.go_on(end_of(window));
    flat_.go_on(steps_.moved());
    if (has_normals_) shade();
    const std::ptrdiff_t ended = has_normals_ ? shaded_ : flat_.ended();
    for (; settled_ < count_; ++settled_) {
      if (ended < std::min<std::ptrdiff_t>(layers_.count(), end_of(settled_) + 1)) return;
      copy_positions_behind(settled_);
      if (has_normals_) copy_behind(settled_, [](Window& of) { return of.normals.data(); });
      begun_.push_back(user_.begin(at(settled_)));
    }
  }

  // Goes on with the normals: a layer's triangles are added to those of its vertices, which are
  // complete then, and of the next layer's.
  void shade() {
    const auto normals_of = [this](std::ptrdiff_t layer) {
      Window& window = at(static_cast<std::size_t>(layer) / depth_);
      return window.normals.data() + view(layer).first();
    };
    const std::ptrdiff_t count = layers_.count();
    for (; shaded_ < count && (flat_.ended() == count || shaded_ + 1 < flat_.ended()); ++shaded_) {
      const LayerView low = view(shaded_);
      const bool is_last = shaded_ + 1 == count;
      const LayerView high = is_last ? LayerView() : view(shaded_ + 1);
      Vec3* const own = normals_of(shaded_);
      Vec3* const next = is_last ? nullptr : normals_of(shaded_ + 1);
      if (shaded_ == 0) std::fill_n(own, low.vertices(), Vec3{});
      if (!is_last) std::fill_n(next, high.vertices(), Vec3{});
      const std::uint64_t split = low.end();
      const auto position = [&](std::uint32_t v) {
        return v < split ? low.positions[v - low.first()] : high.positions[v - split];
      };
      for (const auto& [a, b, c] : low.triangles()) {
        const Vec3 normal = normal_of(position(a), position(b), position(c));
        for (const std::uint32_t v : {a, b, c}) {
          Vec3& sum = v < split ? own[v - low.first()] : next[v - split];
          sum = plus(sum, normal);
        }
      }
      for (std::size_t v = 0; v < low.vertices(); ++v) own[v] = unit(own[v]);
    }
  }

  LayerSource& surface_;
  const Context& context_;
  WindowUser& user_;
  const std::size_t threads_;
  const std::uint32_t depth_;
  const bool has_normals_;
  const std::size_t count_;  // of windows
  std::vector<Window> slots_;
  std::vector<SmoothedLayer> results_;
  const SmoothedLayers layers_;

  // Of the thread that smooths.
  LayerSteps steps_;
  FlatTriangles flat_;
  std::ptrdiff_t shaded_ = 0;       // layers that have their normals
  std::size_t settled_ = 0;         // windows
  std::vector<std::size_t> begun_;  // the parts of those that have settled in this task

  Mutex mutex_;
  Condition changed_;
  bool has_failed_ ISOMESH_GUARDED_BY(mutex_) = false;
  WalkSeconds seconds_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t next_written_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::vector<bool> written_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t smoothed_ ISOMESH_GUARDED_BY(mutex_) = 0;
  bool is_smoothing_ ISOMESH_GUARDED_BY(mutex_) = false;
  std::vector<std::size_t> parts_ ISOMESH_GUARDED_BY(mutex_);  // of each settled window
  std::size_t next_used_ ISOMESH_GUARDED_BY(mutex_) = 0;       // the next part to work on
  std::size_t next_part_ ISOMESH_GUARDED_BY(mutex_) = 0;
  // Parts that wait for their turn to end.
  std::map<std::pair<std::size_t, std::size_t>, WindowUser::InOrder> waiting_
      ISOMESH_GUARDED_BY(mutex_);
  bool is_ending_ ISOMESH_GUARDED_BY(mutex_) = false;
  std::size_t used_ ISOMESH_GUARDED_BY(mutex_) = 0;  // windows before this have ended
  std::size_t used_parts_ ISOMESH_GUARDED_BY(mutex_) = 0;
};

}  // namespace

bool can_walk(const SmoothOptions& options) {
  return options.steps.empty() || options.steps.front().move == Move::kMean;
}

WalkEnd walk(LayerSource& surface, const WalkOptions& options, const Context& context,
             WindowUser& user) {
  const std::uint32_t depth = depth_of(options, surface.count().triangles(), surface.layers());
  return Walk(surface, options, context, user, depth).run();
}

std::uint64_t walking_memory(const WalkOptions& options, const SurfaceSize& size,
                             const WritingMemory& writing) {
  if (size.vertices == 0) return 0;
  const auto threads = static_cast<std::uint64_t>(thread_count());
  const std::uint32_t depth = depth_of(options, size.triangles, size.layers);
  const std::uint64_t windows =
      std::min<std::uint64_t>((size.layers + depth - 1) / depth, windows_at_once(options, depth));
  const std::uint64_t vertices = size.most_vertices(std::uint64_t{depth} + 1);
  // An open plane of triangles has two a vertex.
  constexpr std::uint64_t kTriangles = 2 * sizeof(Triangle);
  const std::uint64_t vectors = block_bytes(vertices * sizeof(Vec3)) * (options.normals ? 2 : 1);
  const std::uint64_t window =
      vectors + block_bytes(vertices * kTriangles) + size.largest_layer() * kTriangles;
  const std::uint64_t written = size.most_vertices(windows * depth + kJoinedLayersBehind);
  return windows * window + written * writing.vertex_bytes + threads * writing.thread_bytes +
         size.largest_layer() * step_bytes_per_vertex(options.smooth.steps.size());
}

}  // namespace isomesh::mesh
