#include <stdexcept>

#include "tests/bench/peers.h"

namespace isomesh::bench {

struct Peers::Vtk {};

bool peers_available() { return false; }

std::string peers_description() {
  return "The peers are missing: VTK was not found when isomesh-bench was built (Debian's package "
         "libvtk9-dev). Install it and build again to compare.";
}

Peers::Peers(const Samples&, double) { throw std::logic_error(peers_description()); }
Peers::~Peers() = default;
void Peers::set_threads(int) {}
void Peers::flying_edges() {}
void Peers::discrete_flying_edges(std::span<const std::int64_t>) {}
void Peers::smooth_labels() {}
void Peers::smooth(int) {}
void Peers::windowed_sinc(int) {}
std::uint64_t Peers::draco() const { return 0; }
std::uint64_t Peers::pipeline() { return 0; }
void Peers::release() {}
MeshSize Peers::size() const { return {}; }

std::vector<DecimationPeer> decimation_peers() { return {}; }

}  // namespace isomesh::bench
