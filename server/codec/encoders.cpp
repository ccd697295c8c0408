#include "server/codec/encoders.h"

#include <algorithm>
#include <utility>

namespace isomesh::codec {

Encoders& Encoders::instance() {
  static Encoders encoders;
  return encoders;
}

std::unique_ptr<DracoEncoder> Encoders::take(std::size_t triangles) {
  const Lock lock(mutex_);
  if (idle_.empty()) return std::make_unique<DracoEncoder>();
  // The smallest that is large enough, otherwise the largest.
  const auto best = std::ranges::min_element(idle_, {}, [&](const auto& encoder) {
    const std::size_t has = encoder->most_triangles();
    return has >= triangles ? std::pair(0, has) : std::pair(1, triangles - has);
  });
  auto encoder = std::move(*best);
  idle_.erase(best);
  idle_triangles_ -= encoder->most_triangles();
  return encoder;
}

void Encoders::give_back(std::unique_ptr<DracoEncoder> encoder) {
  const Lock lock(mutex_);
  if (idle_triangles_ + encoder->most_triangles() > kMostIdleTriangles) return;
  idle_triangles_ += encoder->most_triangles();
  idle_.push_back(std::move(encoder));
}

}  // namespace isomesh::codec
