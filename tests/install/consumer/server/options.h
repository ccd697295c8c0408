// A header of the consumer project with the same name as one of the library.
#pragma once

#define CONSUMER_SERVER_OPTIONS_H 1
