// Where blobs are in S3, and who may use them.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace isomesh::store {

// A bucket of some service that speaks S3, or a part of one.
struct S3Address {
  std::string endpoint;  // http://HOST[:PORT] or https://HOST[:PORT], to which requests are sent
  std::string path;    // of the bucket there: empty where the endpoint's name has the bucket in it
  std::string prefix;  // of all keys: empty, or with a slash at its end
  std::string region;
};

// Whether the value of --blobs is one of these.
bool is_s3_url(std::string_view text);

// Of s3://BUCKET[/PREFIX][?endpoint=URL][&region=NAME][&style=path|host]. Without an endpoint it is
// that of AWS in the region, us-east-1 when there is none. Throws Error kInvalidParameter for
// "blobs".
S3Address parse_s3_url(std::string_view text);

struct S3Credentials {
  std::string access_key;
  std::string secret_key;
  std::string session_token;  // empty without one
};

// Of a file as AWS' tools have it: lines NAME = VALUE with aws_access_key_id, aws_secret_access_key
// and maybe aws_session_token, those below [default] where there are sections. Without a file those
// of AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_SESSION_TOKEN. Throws Error kInvalidParameter
// for "blob-credentials", never with what is in the file.
S3Credentials read_s3_credentials(const std::filesystem::path& file);

}  // namespace isomesh::store
