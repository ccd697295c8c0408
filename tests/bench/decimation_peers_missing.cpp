#include "tests/bench/decimation_peers.h"

namespace isomesh::bench {

std::vector<DecimationPeer> decimation_peers() { return {}; }

}  // namespace isomesh::bench
