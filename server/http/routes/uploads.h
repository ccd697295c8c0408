// What the routes of volumes and those of uploads in parts share; private to these.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "server/http/routes/routes.h"

namespace isomesh::http {

// A body that is here, and the name by which it is kept already; empty without one.
struct KeptBody {
  KeptUploads::Kept file;
  std::string name;
};

// Answers with the volumes that the body becomes when it is read as the request's query says.
void answer_volumes(App& app, const Request& request, Response& response, const KeptBody& body);

// Whether the request says that its body is the beginning of one. Throws Error kInvalidParameter if
// its header Upload-Complete is no boolean.
bool begins_upload(const Request& request);

// Throws Error kInvalidParameter if a request that says that its body is a whole upload tells
// another length of it than `bytes`; empty: not known yet.
void check_told_length(const Request& request, std::optional<std::uint64_t> bytes);

// Answers it with the place where the rest is to go. The query must have been looked at.
void begin_upload(App& app, const Request& request, Response& response);

// Lets go of what is kept where there is not so much room besides.
void make_room_for(App& app, std::uint64_t bytes);

}  // namespace isomesh::http
