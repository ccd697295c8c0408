// Messages between the program and the daemon, and the connection to the peer.
#pragma once

#include <string>
#include <string_view>

#include "server/hospital/dimse/message.h"

namespace isomesh::dimse {

// The first line from the daemon, which also passes the peer's connection. Empty if the daemon no
// longer needs this process.
std::string read_order();

int peer_socket();

// The daemon's verdict on the object reported last. Ends the process if the daemon has closed its
// end.
dimse::DimseVerdict read_verdict();

}  // namespace isomesh::dimse
