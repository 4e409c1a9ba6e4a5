; Where the program is found: each is taken away after its turn. After checks.scm.

(define (turn name)
  (with-picture "rgb.png" (lambda (image layer) (fact name (refusal (lambda () (lay image layer)))))))
(turn "noted")
(file-delete note-path)
(turn "on-path")
(file-delete (in-scratch "bin/smalti"))
(turn "in-home")
(file-delete (in-scratch "home/.cargo/bin/smalti"))
(turn "nowhere")
(close-output-port facts)
