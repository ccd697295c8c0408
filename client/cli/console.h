// Messages to users, and the client that the commands share; private to this folder.
#pragma once

#include <stop_token>
#include <string>

#include "base/error.h"
#include "client/cli/options.h"
#include "client/isomesh/client.h"

namespace isomesh::cli {

Client client_of(const Options& options, const std::stop_token& stop);
// For the last requests, also after an interrupt. The time limits are short, because the user
// waits.
Client parting_client(const Options& options);

// All that the commands write, but meshes and progress bars, goes through the functions below. They
// replace control characters, which a server or a file may send to the terminal. Safe to call from
// several threads.

// A text of whole lines on standard output.
void print(const std::string& lines);
// A line of JSON on standard output, with escapes for the control characters in its texts.
void print_json(const std::string& json);
// A line on standard error that is no error.
void remark(const std::string& line);

// The line for another page of a list, after the command that shows it; nothing without a cursor.
void tell_next(const std::string& command, const std::string& cursor);

// A line on standard error.
void complain(const std::string& message);
// The error, and the options that would resolve it. `subject` is the input that it is about; empty
// if there is only one.
void complain(const Error& error, const std::string& subject = {});

// The hint for a user if no server responds.
void suggest_local();

// Reports the server's notes on a volume or a mesh, unless `options` are quiet; `subject` as above.
void tell_notes(const std::vector<Note>& notes, const Options& options, const std::string& subject);

}  // namespace isomesh::cli
