"""Every action of the review's page, by mouse or keyboard, in a real Chromium on a real server."""
