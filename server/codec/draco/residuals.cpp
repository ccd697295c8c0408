#include "server/codec/draco/residuals.h"

namespace isomesh::codec::edgebreaker {
namespace {

// Writes residuals and counts them. Copies its parameters, because the compiler assumes that its
// stores may alias them.
class SymbolWriter {
 public:
  SymbolWriter(const Wrap& wrap, std::uint16_t* symbols, Histogram& histogram)
      : wrap_(wrap),
        symbols_(symbols),
        x_(histogram.axis(0)),
        y_(histogram.axis(1)),
        z_(histogram.axis(2)) {}

  void put(std::uint32_t at, Lanes value, Lanes predicted) {
    const Lanes symbols = wrap_.symbols_of(value, predicted);
    std::uint16_t* const out = symbols_ + 3 * std::size_t{at};
    out[0] = static_cast<std::uint16_t>(symbols[0]);
    out[1] = static_cast<std::uint16_t>(symbols[1]);
    out[2] = static_cast<std::uint16_t>(symbols[2]);
    ++x_[symbols[0]];
    ++y_[symbols[1]];
    ++z_[symbols[2]];
  }

 private:
  const Wrap wrap_;
  std::uint16_t* const symbols_;
  std::uint32_t* const x_;
  std::uint32_t* const y_;
  std::uint32_t* const z_;
};

}  // namespace

void Residuals::prepare(const Connectivity& surface, const GridPoint* points,
                        const Extent& extent) {
  surface_ = surface;
  points_ = points;
  wrap_ = Wrap(extent);
  symbols_.resize_for_overwrite(3 * std::size_t{surface.vertices} + 3);
}

void Residuals::predict(const std::uint32_t* order, std::uint32_t begin, std::uint32_t end,
                        Histogram& histogram) {
  const Connectivity surface = surface_;
  const GridPoint* const points = points_;
  SymbolWriter writer(wrap_, symbols_.data(), histogram);
  for (std::uint32_t i = begin; i < end; ++i) {
    const Corner corner = order[i];
    if ((corner & kFirstValue) != 0) [[unlikely]] {
      continue;
    }
    const Lanes a = lanes_of(points[surface.vertex(next(corner))]);
    const Lanes b = lanes_of(points[surface.vertex(previous(corner))]);
    const Lanes c = lanes_of(points[surface.vertex(surface.opposite(corner))]);
    writer.put(i, lanes_of(points[surface.vertex(corner)]), a + b - c);
  }
}

void Residuals::predict_firsts(const ValueOrder& order, Histogram& histogram) {
  const auto value = [&](std::uint32_t at) {
    return lanes_of(points_[surface_.vertex(order.corners()[at] & ~kFirstValue)]);
  };
  SymbolWriter writer(wrap_, symbols_.data(), histogram);
  const std::vector<ValueRange>& components = order.components();
  std::size_t component = 0;
  for (const std::uint32_t at : order.firsts()) {
    while (at >= components[component].end) ++component;
    Lanes before = {};
    if (at > components[component].begin) {
      before = value(at - 1);
    } else if (component + 1 < components.size()) {
      before = value(components[component + 1].end - 1);
    }
    writer.put(at, value(at), before);
  }
}

}  // namespace isomesh::codec::edgebreaker
