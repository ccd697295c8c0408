// Shared by the routes of volumes and of resumable uploads. Private to them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "server/http/routes/routes.h"

namespace isomesh::http {

// A received body, and its name if it is already kept.
struct KeptBody {
  KeptUploads::Kept file;
  std::string name = {};
  KeptUploads::Partial partial = {};  // null unless the upload is resumable

  // True if its sender may read it again with other options.
  bool is_to_stay() const;
};

// Answers with the volumes read from the body as the query says. Throws Error kCancelled if the
// upload is cancelled meanwhile.
void answer_volumes(App& app, const Request& request, Response& response, const KeptBody& body);

// True if the body is the first part of an upload. Throws Error kInvalidParameter if the header
// Upload-Complete is not a boolean.
bool begins_upload(const Request& request);

// Throws Error kInvalidParameter if a request with a complete upload declares a length other than
// `bytes`; empty: unknown.
void check_told_length(const Request& request, std::optional<std::uint64_t> bytes);

// Answers with the URL for the rest. The query must be checked before.
void begin_upload(App& app, const Request& request, Response& response);

// Deletes kept uploads if there are no `bytes` of free space, and would be then.
void make_room_for(App& app, std::uint64_t bytes);

}  // namespace isomesh::http
