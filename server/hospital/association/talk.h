// What the program and the daemon say to each other, and the one connection that it has to a peer.
#pragma once

#include <string>
#include <string_view>

#include "server/process/dimse_message.h"

namespace isomesh::association {

// Its first line from the daemon, with which the connection to the peer has come. Empty when the
// daemon has no use for this process any more.
std::string read_order();

// The descriptor of that connection.
int peer_socket();

// Ends the process when the daemon has closed its end.
void say(std::string_view line);

// What the daemon says of the object that it was told of last. Ends the process as say() does.
process::DimseVerdict hear_verdict();

}  // namespace isomesh::association
